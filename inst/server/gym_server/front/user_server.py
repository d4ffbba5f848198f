"""A user's own server: an ordinary one, as a child process of the front."""

from __future__ import annotations

import contextlib
import logging
import secrets
import socket
import subprocess
import time
from collections import deque
from selectors import EVENT_READ, BaseSelector
from typing import Any, NamedTuple

from gym_server.front import control_groups
from gym_server.front.handed_over import VARIABLE
from gym_server.front.python import command, environment
from gym_server.front.request_head import RequestHead
from gym_server.front.starts import Start
from gym_server.front.users_file import User

log = logging.getLogger(__name__)

# The connections of a user that may wait until the server takes them.
MOST_WAITING = 64

# How long a server may take to start, and to end when it was asked to, in seconds. It gives
# requests in progress ten seconds.
_START_SECONDS = 120.0
_END_SECONDS = 15.0


class Client(NamedTuple):
    """A connection whose user, or watch page, is known.

    Attributes:
        socket: the socket.
        head: that of its first request, which nobody has taken from the socket yet.
    """

    socket: socket.socket
    head: RequestHead


class UserServer:
    """A running server.

    Attributes:
        user: its user.
        route: what the keys of its watch pages begin with.
        waiting: the connections that it has not taken yet.
        has_started: whether it has taken any.
        is_ending: whether it takes no more.
    """

    def __init__(self, selector: BaseSelector, user: User, token: bytes, start: Start) -> None:
        """Start it.

        Args:
            selector: calls the data that it has for a socket.
            user: the user.
            token: the user's token, which every request must have.
            start: how to start it.

        Raises:
            OSError: it cannot be started.
        """
        self._selector = selector
        self.user = user
        self.route = secrets.token_urlsafe(9)
        self.waiting: deque[Client] = deque()
        self.has_started = False
        self.is_ending = False
        self._group = start.group
        self._kill_at = time.monotonic() + _START_SECONDS
        # It ends when this closes, so also when the front is killed.
        self._socket, its_socket = socket.socketpair()
        variables = environment() | {
            "GYM_SERVER_TOKEN": token.decode("ascii"),
            "GYM_SERVER_WATCH_PREFIX": f"{self.route}.",
            VARIABLE: str(its_socket.fileno()),
        }
        account: dict[str, Any] = {}
        if start.uid is None:
            # The files of one user are those of all.
            variables["GYM_SERVER_SHARED_ACCOUNT"] = "1"
        else:
            variables["HOME"] = str(start.folder)
            account = {"user": start.uid, "group": start.uid, "extra_groups": []}
        with its_socket:
            self._process = subprocess.Popen(
                command(*start.arguments),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=[its_socket.fileno()],
                cwd=start.folder,
                env=variables,
                start_new_session=True,
                **account,
            )
        if start.group is not None:
            control_groups.add(start.group, self._process.pid)
        self._socket.setblocking(False)
        selector.register(self._socket, EVENT_READ, self._note_taken)
        log.info("Started the server of %s (process %d)", user.name, self._process.pid)

    def add(self, client: Client) -> None:
        """Hand a connection over, or let it wait until another server can be started.

        Raises:
            OSError: the system does not hand over so many at a time.
        """
        if not self.is_ending:
            with contextlib.suppress(ConnectionError):
                socket.send_fds(self._socket, [b"x"], [client.socket.fileno()])
        self.waiting.append(client)

    def _note_taken(self, events: int) -> None:
        """Close the front's copies of the connections that the server has now."""
        try:
            taken = len(self._socket.recv(MOST_WAITING))
        except OSError:
            taken = 0
        for _ in range(taken):
            self.waiting.popleft().socket.close()
        self.has_started = self.has_started or taken > 0
        if not taken:
            self.end()
            self._selector.unregister(self._socket)
            self._socket.close()

    def end(self) -> None:
        """Ask it to end after the requests in progress."""
        if not self.is_ending:
            self.is_ending = True
            self._kill_at = time.monotonic() + _END_SECONDS
            with contextlib.suppress(OSError):
                self._socket.shutdown(socket.SHUT_WR)

    def has_ended(self) -> bool:
        """Return whether its process has ended; kill one that takes too long to start or to end."""
        is_late = time.monotonic() > self._kill_at
        if is_late and (self.is_ending or not self.has_started):
            self._process.kill()
        return self._process.poll() is not None

    def clean_up(self) -> list[Client]:
        """Close what belongs to it after its end; return the connections that it did not take."""
        while self._socket.fileno() >= 0:
            self._note_taken(EVENT_READ)
        if self._group is not None:
            control_groups.remove(self._group)
        log.info("The server of %s has ended (%d)", self.user.name, self._process.returncode)
        return list(self.waiting)
