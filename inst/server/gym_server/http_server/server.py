"""The server: a port, a thread per connection, and a stop that loses no response."""

from __future__ import annotations

import contextlib
import errno
import logging
import math
import select
import socket
import sys
import threading
import time

from gym_server import memory
from gym_server.http_server.connection import Application, Connection

log = logging.getLogger(__name__)

# Each has a thread, which takes some memory.
_MOST_CONNECTIONS = 512

# How many connections end to make room.
_ENDED_AT_ONCE = 8

# The interval between two warnings, in seconds.
_WARN_SECONDS = 10.0

# How long to wait, if there is no room for a connection, for another one to end.
_MOMENT_SECONDS = 0.1

# After the stop, a client that has sent part of a request gets this long to send the rest.
_HALF_SENT_SECONDS = 2.0


def bind(host: str, port: int) -> socket.socket:
    """Bind a port for this process alone.

    Args:
        host: an address, or a name that resolves to one.
        port: a port number; 0 picks a free port.

    Returns:
        A listening socket: clients can connect from now on.

    Raises:
        OSError: the port is taken, or the host is not an address of this machine.
    """
    family, kind, protocol, _, address = socket.getaddrinfo(
        host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    listener = socket.socket(family, kind, protocol)
    try:
        if sys.platform == "win32":
            # With SO_REUSEADDR, Windows would let another process take over the port.
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_EXCLUSIVEADDRUSE, 1)
        else:
            # Lets a new server start while connections of the old one linger. A port that another
            # process listens on is still refused.
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(1024)
    except BaseException:
        listener.close()
        raise
    return listener


class Server:
    """A server on a bound socket."""

    def __init__(self, app: Application, listener: socket.socket, max_body_bytes: int) -> None:
        """Prepare to serve; ``run()`` starts.

        Args:
            app: the application.
            listener: a listening socket from ``bind()``.
            max_body_bytes: the size of the largest request body.
        """
        self._app = app
        self._listener = listener
        self._max_body_bytes = max_body_bytes
        host, self.port = listener.getsockname()[:2]
        self._base_environ = {
            "SCRIPT_NAME": "",
            "SERVER_NAME": host,
            "SERVER_PORT": str(self.port),
            "wsgi.url_scheme": "http",
        }
        # Each until its thread has ended.
        self._connections: set[Connection] = set()
        self._changed = threading.Condition()
        self._warned = -math.inf
        self._stop_asked = threading.Event()
        self._wake, self._waker = socket.socketpair()

    def stop(self) -> None:
        """Ask ``run()`` to end; may be called from any thread or signal handler."""
        self._stop_asked.set()
        # run() closes this socket when it ends.
        with contextlib.suppress(OSError):
            self._waker.send(b"x")

    def run(self, grace: float) -> bool:
        """Serve until ``stop()`` is called, then answer the requests in progress.

        Args:
            grace: seconds for these requests to finish.

        Returns:
            Whether all of them were answered.
        """
        self._listener.setblocking(False)
        while not self._stop_asked.is_set():
            # On Windows, signals are handled only after the wait.
            if self._listener in select.select([self._listener, self._wake], [], [], 1.0)[0]:
                # Without memory for a connection, its client finds it closed.
                with contextlib.suppress(MemoryError):
                    self._accept()
        self._listener.close()
        self._wake.close()
        self._waker.close()
        self._app.begin_stop()
        return self._drain(grace)

    def _drain(self, grace: float) -> bool:
        """End the connections as they have no request in progress; return whether all ended."""
        stopped = time.monotonic()
        with self._changed:
            while self._connections and time.monotonic() < stopped + grace:
                half_sent = time.monotonic() > stopped + _HALF_SENT_SECONDS
                for connection in self._connections:
                    connection.stop(half_sent)
                self._changed.wait(0.05)
            return not self._connections

    def _accept(self) -> None:
        if len(self._connections) >= _MOST_CONNECTIONS:
            # Further clients wait in the socket's backlog.
            self._make_room(f"No more connections: it has {_MOST_CONNECTIONS}")
            return
        try:
            client, address = self._listener.accept()
        except OSError as error:
            if error.errno in (errno.EMFILE, errno.ENFILE):
                self._make_room("No more connections: this process may open no more files")
            return  # Otherwise the client has already left.
        client.setblocking(True)
        environ = {**self._base_environ, "REMOTE_ADDR": address[0]}
        connection = Connection(client, self._app, environ, self._max_body_bytes)
        with self._changed:
            self._connections.add(connection)
        # A daemon thread, so that a call that never returns does not keep the process alive.
        thread = threading.Thread(target=self._serve, args=(connection,), daemon=True)
        try:
            with memory.for_threads():
                thread.start()
        except RuntimeError:
            client.close()
            self._remove(connection)
            self._make_room("No more connections: this process may start no more threads")

    def _make_room(self, why: str) -> None:
        """End the connections of the first ranks, and wait briefly until any has ended."""
        # A client can trigger this a thousand times a second.
        if time.monotonic() > self._warned + _WARN_SECONDS:
            self._warned = time.monotonic()
            log.warning("%s", why)
        with self._changed:
            ranks = {one: rank for one in self._connections if (rank := one.rank) is not None}
            for one in sorted(ranks, key=ranks.__getitem__)[:_ENDED_AT_ONCE]:
                one.end()
            self._changed.wait(_MOMENT_SECONDS)

    def _serve(self, connection: Connection) -> None:
        try:
            connection.serve()
        except Exception:
            log.exception("A connection ended because of a bug in the server")
        finally:
            self._remove(connection)

    def _remove(self, connection: Connection) -> None:
        with self._changed:
            self._connections.discard(connection)
            self._changed.notify()
