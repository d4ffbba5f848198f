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
import math
import os
import select
import socket
import threading
import time
from collections.abc import Callable

from gym_server.budget import Budget
from gym_server.http_server import connections
from gym_server.http_server.connection import Connection
from gym_server.http_server.connections import Connections

log = logging.getLogger(__name__)

# Between two looks after those who do not read, and between two warnings.
_LOOK_SECONDS = 1.0
_WARN_SECONDS = 10.0

# How many of the largest bodies may be on their way at a time; parts of bodies, and small ones,
# which do not count, make it many more.
_LARGEST_BODIES = 16

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
        knows: Callable[[dict], bool] = lambda environ: True,
    ) -> None:
        """Serve nothing yet: ``run()`` does.

        Args:
            app: a WSGI application.
            listener: a listening socket, as ``bind()`` returns it.
            max_body_bytes: the size of the largest request body.
            on_stop: called when the stop has come and requests are still under way.
            admit: raises the refusal of a request whose large body is still to come.
            knows: tells by WSGI's environment whether a request comes from one who may stay
                connected; asked until it does.
        """
        self._app = app
        self._on_stop = on_stop
        self._admit = admit
        self._knows = knows
        self._listener = listener
        self._max_body_bytes = max_body_bytes
        self._bodies = Budget(_LARGEST_BODIES * max_body_bytes)
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
        self._connections = Connections()
        self._warned = -math.inf
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
        looked = time.monotonic()
        while not self._stop_asked.is_set():
            # Windows tells of a signal only when the wait is over.
            if self._listener in select.select([self._listener, self._wake], [], [], 1.0)[0]:
                self._accept()
            if time.monotonic() > looked + _LOOK_SECONDS:
                looked = time.monotonic()
                self._connections.shed_unsent()
        self._listener.close()
        self._wake.close()
        self._waker.close()
        self._on_stop()
        return self._connections.drain(grace, _HALF_SENT_SECONDS)

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
        for connection in self._connections.served_by(thread):
            connection.answer_for(status, headers, body)
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
            return  # Else it has left again.
        client.setblocking(True)
        connection = Connection(
            client,
            self._app,
            {**self._base_environ, "REMOTE_ADDR": address[0]},
            self._max_body_bytes,
            self._bodies.share(),
            self._admit,
            self._knows,
        )
        if not self._connections.add(connection, address[0]):
            self._warn(f"No more connections from {address[0]}: all that it has are at work")
            client.close()
            return
        # A daemon: an environment that never comes back must not keep the process.
        thread = threading.Thread(target=self._serve, args=(connection,), daemon=True)
        try:
            thread.start()
        except RuntimeError:
            self._warn("No more connections: this process may start no more threads")
            self._connections.remove(connection)
            client.close()
            self._connections.make_room()

    def _warn(self, message: str) -> None:
        # Whoever brings this about can do so a thousand times a second.
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
