"""The connections that the front hands over to a user's server, which then has them to itself."""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Callable

# The environment variable with the number of the open socket from which they come.
VARIABLE = "GYM_SERVER_FRONT"


class HandedOver(socket.socket):
    """Stands for a listening socket in a user's server."""

    def __init__(self, front: int, stop: Callable[[], None]) -> None:
        """Take the socket that the front has left open.

        Args:
            front: its number.
            stop: is called when the front wants the server to end, or has ended.
        """
        super().__init__(fileno=front)
        self.set_inheritable(False)
        self._stop = stop

    def getsockname(self) -> tuple[str, int]:
        """Return the address of no port: this server listens on none."""
        return "127.0.0.1", 0

    def accept(self) -> tuple[socket.socket, tuple]:
        """Take a connection, and tell the front, which then closes its own copy of it.

        Raises:
            OSError: there is none.
        """
        message, taken, _, _ = socket.recv_fds(self, 1, 1)
        if not message:
            self._stop()
            raise ConnectionError("the front hands over no more")
        self.send(b"x")
        if not taken:
            # The system has closed it.
            raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
        client = socket.socket(fileno=taken[0])
        return client, client.getpeername()
