"""The server: a port, a thread for each connection, and a stop that loses no answer."""

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

from gym_server.budget import Budget
from gym_server.http_server import connections
from gym_server.http_server.connection import Connection
from gym_server.http_server.connections import Connections
from gym_server.http_server.interface import Application
from gym_server.response import Response

log = logging.getLogger(__name__)

# Between two searches for clients that do not read their answers, and between two warnings.
_SEARCH_SECONDS = 1.0
_WARN_SECONDS = 10.0

# After the stop a client that has sent half a request has this long to send the rest.
_HALF_SENT_SECONDS = 2.0


def bind(host: str, port: int) -> socket.socket:
    """Bind a port for this process alone.

    Args:
        host: an address, or a name that has one.
        port: a number; 0 takes a free one.

    Returns:
        A listening socket: from now on clients can connect.

    Raises:
        OSError: the port is taken, or the host is not an address of this machine.
    """
    family, kind, protocol, _, address = socket.getaddrinfo(
        host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    listener = socket.socket(family, kind, protocol)
    try:
        if sys.platform == "win32":
            # On Windows SO_REUSEADDR would let another process take the port over.
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_EXCLUSIVEADDRUSE, 1)
        else:
            # A new server can start while connections of the old one linger. A port on which
            # another process listens stays refused.
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
        app: Application,
        listener: socket.socket,
        max_body_bytes: int,
        bodies: Budget,
    ) -> None:
        """Prepare; ``run()`` serves.

        Args:
            app: the application.
            listener: a listening socket, as ``bind()`` returns it.
            max_body_bytes: the size of the largest request body.
            bodies: the memory for the bodies of all requests; small ones take none of it.
        """
        self._app = app
        self._listener = listener
        self._max_body_bytes = max_body_bytes
        self._bodies = bodies
        host, self.port = listener.getsockname()[:2]
        self._base_environ = {
            "SCRIPT_NAME": "",
            "SERVER_NAME": host,
            "SERVER_PORT": str(self.port),
            "wsgi.url_scheme": "http",
        }
        self._connections = Connections()
        self._warned = -math.inf
        self._stop_asked = threading.Event()
        self._wake, self._waker = socket.socketpair()

    def stop(self) -> None:
        """Ask ``run()`` to end; callable from any thread and signal handler."""
        self._stop_asked.set()
        # After run() this socket is closed.
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
        searched = time.monotonic()
        while not self._stop_asked.is_set():
            # Windows handles a signal only when the wait is over.
            if self._listener in select.select([self._listener, self._wake], [], [], 1.0)[0]:
                self._accept()
            if time.monotonic() > searched + _SEARCH_SECONDS:
                searched = time.monotonic()
                self._connections.evict_unread()
        self._listener.close()
        self._wake.close()
        self._waker.close()
        self._app.begin_stop()
        return self._connections.drain(grace, _HALF_SENT_SECONDS)

    def answer_for(self, thread: int, response: Response) -> None:
        """Answer on behalf of a thread that is stuck in the application."""
        for connection in self._connections.served_by(thread):
            connection.answer_for(response)
            self._connections.remove(connection)

    def _accept(self) -> None:
        if len(self._connections) >= connections.MOST_CONNECTIONS:
            # The others wait in the queue of the listening socket.
            self._connections.make_room()
            return
        try:
            client, address = self._listener.accept()
        except OSError as error:
            if error.errno in (errno.EMFILE, errno.ENFILE):
                self._warn("No more connections: this process may open no more files")
                self._connections.make_room()
            return  # Otherwise the client has left again.
        client.setblocking(True)
        connection = Connection(
            client,
            self._app,
            {**self._base_environ, "REMOTE_ADDR": address[0]},
            self._max_body_bytes,
            self._bodies.share(),
        )
        if not self._connections.add(connection, address[0]):
            self._warn(f"No more connections from {address[0]}: all that it has are at work")
            client.close()
            return
        # A daemon: a call of the application that never returns must not keep the process alive.
        thread = threading.Thread(target=self._serve, args=(connection,), daemon=True)
        try:
            thread.start()
        except RuntimeError:
            self._warn("No more connections: this process may start no more threads")
            self._connections.remove(connection)
            client.close()
            self._connections.make_room()

    def _warn(self, message: str) -> None:
        # A client can cause this a thousand times a second.
        if time.monotonic() > self._warned + _WARN_SECONDS:
            self._warned = time.monotonic()
            log.warning("%s", message)

    def _serve(self, connection: Connection) -> None:
        try:
            connection.serve()
        except Exception:
            log.exception("A connection ended by a fault of the server's own")
        finally:
            self._connections.remove(connection)
