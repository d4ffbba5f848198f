"""Serve the application: sockets, threads, and a stop that loses no answer.

waitress serves it: one process, threads, kept-alive connections, the same on Windows, macOS
and Linux.  What is particular to waitress, internals included, stays in this file.

Why waitress: microseconds a request on one kept-alive connection, Flask / bare WSGI (medians of
5 interleaved rounds of 5,000 on two noisy cores): waitress 3.0.2 310/185, cheroot 11.1.2
350/206, granian 2.8.7 236/104.  cheroot waits for 50,000 with the selector that it has on
Windows; granian serves from a child process and takes no socket that we bound; Werkzeug's
development server closes each connection (753).
"""

from __future__ import annotations

import os
import socket
import threading
import time

from waitress import wasyncore
from waitress.channel import HTTPChannel
from waitress.parser import HTTPRequestParser
from waitress.server import TcpWSGIServer, create_server
from waitress.task import ErrorTask, WSGITask
from waitress.utilities import RequestEntityTooLarge

from gym_server import wire
from gym_server.errors import GymServerError, answer_to

# A request occupies its thread while it waits for its environment, so there must be more of
# them than environments that are slow at the same time.
_THREADS = 32

# Bytes of a request that is refused for its size, read so that its sender sees the answer.
_DISCARD_AT_MOST = 2**30

# A client that sent half a request when the stop came may be gone.
_HALF_SENT_SECONDS = 2.0


def bind(host: str, port: int) -> socket.socket:
    """Bind a port for this process alone.

    Args:
        host: an address, or a name that has one.
        port: a number; 0 takes a free one.

    Returns:
        A listening socket: from now on connections are accepted.

    Raises:
        OSError: the port is taken, or the host is none of this machine's.
    """
    family, kind, protocol, _, address = socket.getaddrinfo(
        host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    listener = socket.socket(family, kind, protocol)
    try:
        if os.name == "nt":
            # There SO_REUSEADDR would let another process take the port over.
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_EXCLUSIVEADDRUSE, 1)
        else:
            # Lets a new server start while the old one's connections linger; a port that
            # somebody listens on stays refused.
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(1024)
    except BaseException:
        listener.close()
        raise
    return listener


class Server:
    """A server on a bound socket."""

    def __init__(self, app, listener: socket.socket, max_body_bytes: int) -> None:
        """Start the threads that serve requests; ``run()`` reads them."""
        self.port: int = listener.getsockname()[1]
        self._stop_asked = threading.Event()
        self._server: TcpWSGIServer = create_server(
            app,
            sockets=[listener],
            threads=_THREADS,
            # waitress refuses from this size on.
            max_request_body_size=max_body_bytes + 1,
            ident=None,
            asyncore_use_poll=True,
            # select(), all that Windows has, takes 512 sockets.
            connection_limit=480 if os.name == "nt" else 4000,
            channel_timeout=3600,
            backlog=1024,
        )
        self._server.channel_class = _Channel

    def stop(self) -> None:
        """Ask ``run()`` to come to its end; callable from any thread and signal handler."""
        self._stop_asked.set()
        # After run() its file descriptor may be somebody else's.
        if not self._server.trigger._closed:
            self._server.pull_trigger()

    def run(self, grace: float) -> bool:
        """Serve until ``stop()``, then answer the requests under way.

        Args:
            grace: seconds that these may take.

        Returns:
            Whether all of them were answered.
        """
        while not self._stop_asked.is_set():
            self._serve_for(1.0)
        stopped = time.monotonic()
        deadline = stopped + grace
        self._stop_listening()
        while self._server.active_channels and time.monotonic() < deadline:
            self._close_idle(half_sent=time.monotonic() > stopped + _HALF_SENT_SECONDS)
            self._serve_for(0.05)
        answered = not self._server.active_channels
        left = max(deadline - time.monotonic(), 0.1)
        self._server.task_dispatcher.shutdown(cancel_pending=True, timeout=left)
        wasyncore.close_all(self._server._map)
        return answered

    def _serve_for(self, seconds: float) -> None:
        wasyncore.loop(seconds, use_poll=True, map=self._server._map, count=1)

    def _stop_listening(self) -> None:
        # Not close(), which also closes the trigger that wakes this loop for answers.
        self._server.accepting = False
        self._server.del_channel()
        self._server.socket.close()

    def _close_idle(self, half_sent: bool) -> None:
        for channel in list(self._server.active_channels.values()):
            with channel.requests_lock:
                if not channel.requests and (half_sent or channel.request is None):
                    channel.close_when_flushed = True


class _Parser(HTTPRequestParser):
    """Reads a request that is too large to its end, without keeping it.

    Closing the connection on a client that still writes would reset it, and the client would
    never see the answer that explains.
    """

    def received(self, data: bytes) -> int:
        consumed = super().received(data)
        if isinstance(self.error, RequestEntityTooLarge):
            if self.expect_continue:
                # This client waits for a word before it writes.
                self.expect_continue = False
            elif not self.body_rcv.completed and self.body_bytes_received < _DISCARD_AT_MOST:
                self.body_rcv.buf = _Nowhere()
                self.completed = False
        return consumed


class _Nowhere:
    """A buffer that keeps nothing."""

    def append(self, data: bytes) -> None:
        pass

    def __len__(self) -> int:
        return 0

    def close(self) -> None:
        pass


class _Task(WSGITask):
    """Sends header and body in one packet, and keeps the connection after a 204."""

    def write(self, data: bytes) -> None:
        if self.wrote_header or not data:
            super().write(data)
            return
        channel = self.channel
        self.channel = head = _Collector(channel)
        try:
            super().write(data)
        finally:
            self.channel = channel
        channel.write_soon(b"".join(head.pieces))

    def set_close_on_finish(self) -> None:
        # waitress closes after every answer without a length; a 204 needs none.
        if self.has_body or self.request.connection_close or self.version == "1.0":
            super().set_close_on_finish()


class _Collector:
    """Stands in for a channel and collects what is written to it."""

    def __init__(self, channel: HTTPChannel) -> None:
        self.server = channel.server
        self.pieces: list[bytes] = []

    def write_soon(self, data: bytes) -> int:
        self.pieces.append(data)
        return len(data)


class _ErrorTask(ErrorTask):
    """Answers in JSON what waitress itself refuses."""

    def execute(self) -> None:
        refused = self.request.error
        if isinstance(refused, RequestEntityTooLarge):
            code, message = "body_too_large", "The request's body is larger than this server takes"
        else:
            code, message = "malformed_json", f"The request cannot be read: {refused.body}"
        status, body = answer_to(GymServerError(code, message))
        self.status = f"{status} {refused.reason}"
        self.response_headers.append(("Content-Type", wire.JSON))
        data = wire.dumps(body)
        self.content_length = len(data)
        self.set_close_on_finish()
        self.write(data)


class _Channel(HTTPChannel):
    task_class = _Task
    error_task_class = _ErrorTask
    parser_class = _Parser
