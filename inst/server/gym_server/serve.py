"""Serve the application: a port, a thread for each connection, a stop that loses no answer.

Why no ready-made server: those that run on Windows, macOS and Linux hand each request over from
the thread that waits for it to one that answers it. Here the thread that answers waits itself.
Microseconds a request on one kept-alive connection, a bare WSGI application / Flask (medians of 5
interleaved rounds of 3,000 on two noisy cores): this one 37/206, waitress 3.0.2 156/296; measured
earlier and elsewhere, beside waitress with 185/310: cheroot 11.1.2 206/350, granian 2.8.7 104/236
(from a child process, on no socket of ours).
"""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import select
import socket
import threading
import time
from collections.abc import Callable
from itertools import islice

from gym_server.connection import Connection

log = logging.getLogger(__name__)

# Threads that only wait for their client cost some memory.
_MOST_CONNECTIONS = 4000

# How many of them leave at once for others.
_MAKES_ROOM = 100

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

    def __init__(
        self,
        app: Callable,
        listener: socket.socket,
        max_body_bytes: int,
        on_stop: Callable[[], None] = lambda: None,
        admit: Callable[[dict], None] = lambda environ: None,
    ) -> None:
        """Serve nothing yet: ``run()`` does.

        Args:
            app: a WSGI application.
            listener: a listening socket, as ``bind()`` returns it.
            max_body_bytes: the size of the largest request body.
            on_stop: called when the stop has come and requests are still under way.
            admit: raises the refusal of a request whose large body is still to come.
        """
        self._app = app
        self._on_stop = on_stop
        self._admit = admit
        self._listener = listener
        self._max_body_bytes = max_body_bytes
        host, self.port = listener.getsockname()[:2]
        self._base_environ = {
            "SCRIPT_NAME": "",
            "SERVER_NAME": host,
            "SERVER_PORT": str(self.port),
            "wsgi.version": (1, 0),
            "wsgi.url_scheme": "http",
            "wsgi.multithread": True,
            "wsgi.multiprocess": False,
            "wsgi.run_once": False,
        }
        self._connections: set[Connection] = set()
        self._changed = threading.Condition()
        self._stop_asked = threading.Event()
        self._wake, self._waker = socket.socketpair()

    def stop(self) -> None:
        """Ask ``run()`` to come to its end; callable from any thread and signal handler."""
        self._stop_asked.set()
        # After run() there is nobody to wake.
        with contextlib.suppress(OSError):
            self._waker.send(b"x")

    def run(self, grace: float) -> bool:
        """Serve until ``stop()``, then answer the requests under way.

        Args:
            grace: seconds that these may take.

        Returns:
            Whether all of them were answered.
        """
        self._listener.setblocking(False)
        while not self._stop_asked.is_set():
            # Windows tells of a signal only when the wait is over.
            if self._listener in select.select([self._listener, self._wake], [], [], 1.0)[0]:
                self._accept()
        self._listener.close()
        self._wake.close()
        self._waker.close()
        self._on_stop()
        return self._drain(grace)

    def _drain(self, grace: float) -> bool:
        stopped = time.monotonic()
        with self._changed:
            while self._connections and time.monotonic() < stopped + grace:
                half_sent = time.monotonic() > stopped + _HALF_SENT_SECONDS
                for connection in self._connections:
                    connection.stop(half_sent)
                self._changed.wait(0.05)
            return not self._connections

    def answer_for(
        self, thread: int, status: str, headers: list[tuple[str, str]], body: bytes
    ) -> None:
        """Answer on behalf of a thread that is stuck in the application.

        Args:
            thread: its identity.
            status: as for WSGI.
            headers: as for WSGI.
            body: what follows them.
        """
        with self._changed:
            stuck = [one for one in self._connections if one.thread == thread]
        for connection in stuck:
            connection.answer_for(status, headers, body)
            self._forget(connection)

    def _accept(self) -> None:
        if len(self._connections) >= _MOST_CONNECTIONS:
            self._make_room()
            return
        try:
            client, address = self._listener.accept()
        except OSError as error:
            if error.errno in (errno.EMFILE, errno.ENFILE):
                log.warning("No more connections: this process may open no more files")
                time.sleep(1.0)
            return  # Else it has left again.
        client.setblocking(True)
        environ = {**self._base_environ, "REMOTE_ADDR": address[0]}
        connection = Connection(client, self._app, environ, self._max_body_bytes, self._admit)
        with self._changed:
            self._connections.add(connection)
        # A daemon: an environment that never comes back must not keep the process.
        thread = threading.Thread(target=self._serve, args=(connection,), daemon=True)
        try:
            thread.start()
        except RuntimeError:
            log.warning("No more connections: this process may start no more threads")
            self._forget(connection)
            client.close()
            time.sleep(1.0)

    def _serve(self, connection: Connection) -> None:
        try:
            connection.serve()
        except Exception:
            log.exception("A connection ended by a fault of the server's own")
        finally:
            self._forget(connection)

    def _forget(self, connection: Connection) -> None:
        with self._changed:
            self._connections.discard(connection)
            self._changed.notify()

    def _make_room(self) -> None:
        """Send those away whose clients have been silent for longest; they may come again."""
        with self._changed:
            silent = sorted(self._connections, key=lambda connection: connection.silent_since)
            leaving = list(islice((one for one in silent if one.give_way()), _MAKES_ROOM))
            # The others wait in the queue of the listening socket.
            if len(self._connections) >= _MOST_CONNECTIONS:
                self._changed.wait(0.1 if leaving else 1.0)
