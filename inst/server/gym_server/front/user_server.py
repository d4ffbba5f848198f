"""A user's own server: an ordinary one, as a child process of the front."""

from __future__ import annotations

import contextlib
import logging
import os
import secrets
import socket
import subprocess
import time
from dataclasses import dataclass
from selectors import EVENT_READ, BaseSelector
from typing import Any

from gym_server.front import control_groups
from gym_server.front.python import command, environment
from gym_server.front.relay import Relay
from gym_server.front.request_head import RequestHead
from gym_server.front.starts import Start
from gym_server.front.users_file import User

log = logging.getLogger(__name__)

_ADDRESS = b"Server starting at: http://127.0.0.1:"

# The connections of a user, and as many of the watch pages of that user.
MOST_CONNECTIONS = 64

# How long a server may take to start, and to end when it was asked to, in seconds. It gives
# requests in progress ten seconds.
_START_SECONDS = 120.0
_END_SECONDS = 15.0


@dataclass(eq=False)
class Client:
    """A connection whose user, or watch page, is known.

    Attributes:
        socket: the socket.
        request: what it has sent.
        head: what was read of it.
        watches: whether it has a watch page's key, and not the token.
    """

    socket: socket.socket
    request: bytes
    head: RequestHead
    watches: bool = False


class UserServer:
    """A running server.

    Attributes:
        user: its user.
        route: what the keys of its watch pages begin with.
        clients: its connections; those with None wait until it has started, or until it has ended
            and another can be started.
        is_ending: whether it takes no more connections.
    """

    def __init__(self, selector: BaseSelector, user: User, token: bytes, start: Start) -> None:
        """Start it.

        Args:
            selector: as for ``Relay``.
            user: the user.
            token: the user's token, which every request must have.
            start: how to start it.

        Raises:
            OSError: it cannot be started.
        """
        self._selector = selector
        self.user = user
        self.route = secrets.token_urlsafe(9)
        self.clients: dict[Client, Relay | None] = {}
        self.is_ending = False
        self._group = start.group
        self._port: int | None = None
        self._said = b""
        self._used_at = time.monotonic()
        self._kill_at = self._used_at + _START_SECONDS
        variables = environment() | {
            "GYM_SERVER_TOKEN": token.decode("ascii"),
            "GYM_SERVER_WATCH_PREFIX": f"{self.route}.",
        }
        account: dict[str, Any] = {}
        if start.uid is None:
            # The files of one user are those of all.
            variables["GYM_SERVER_SHARED_ACCOUNT"] = "1"
        else:
            variables["HOME"] = str(start.folder)
            account = {"user": start.uid, "group": start.uid, "extra_groups": []}
        # It ends when its standard input closes, so also when the front is killed.
        self._process = subprocess.Popen(
            command("--stop-on-stdin-eof", "--port", "0", *start.arguments),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=start.folder,
            env=variables,
            start_new_session=True,
            **account,
        )
        assert self._process.stdin is not None and self._process.stdout is not None
        self._input, self._output = self._process.stdin, self._process.stdout
        if start.group is not None:
            control_groups.add(start.group, self._process.pid)
        selector.register(self._output, EVENT_READ, self._listen)
        log.info("Started the server of %s (process %d)", user.name, self._process.pid)

    def takes(self, client: Client) -> bool:
        """Return whether there is room for another connection of its kind."""
        same = [one for one in self.clients if one.watches == client.watches]
        return len(same) < MOST_CONNECTIONS

    def add(self, client: Client) -> None:
        """Pass a connection on, or let it wait."""
        self.clients[client] = None
        if self._port is not None and not self.is_ending:
            self._connect(client, self._port)

    def _connect(self, client: Client, port: int) -> None:
        def ended() -> None:
            del self.clients[client]
            self._used_at = time.monotonic()

        def refused() -> None:
            # It is about to end.
            self.clients[client] = None
            self.end()

        try:
            server = socket.socket()
        except OSError as error:
            log.warning("No more connections: %s", error.strerror)
            client.socket.close()
            ended()
            return
        server.setblocking(False)
        server.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        server.connect_ex(("127.0.0.1", port))
        self.clients[client] = Relay(
            self._selector, client.socket, server, client.request, ended, refused
        )

    def _listen(self, events: int) -> None:
        """Read the address that the server prints when it has started."""
        said = os.read(self._output.fileno(), 1024)
        self._said += said
        line, end, _ = self._said.partition(b"\n")
        if end or not said:
            self._selector.unregister(self._output)
        if end and line.startswith(_ADDRESS):
            self._port = int(line.removeprefix(_ADDRESS))
            for client in list(self.clients):
                self._connect(client, self._port)

    def is_unused(self, seconds: float) -> bool:
        """Return whether nobody has used it for so long, and no request is in progress."""
        relays = [relay for relay in self.clients.values() if relay is not None]
        if len(relays) < len(self.clients) or any(relay.is_busy for relay in relays):
            return False
        return time.monotonic() > seconds + max(
            (relay.moved_at for relay in relays), default=self._used_at
        )

    def end(self) -> None:
        """Ask it to end after the requests in progress."""
        if not self.is_ending:
            self.is_ending = True
            self._kill_at = time.monotonic() + _END_SECONDS
            with contextlib.suppress(OSError):
                self._input.close()

    def has_ended(self) -> bool:
        """Return whether its process has ended; kill one that takes too long to start or to end."""
        is_late = time.monotonic() > self._kill_at
        if is_late and (self._port is None or self.is_ending):
            self._process.kill()
        return self._process.poll() is not None

    def clean_up(self) -> list[Client]:
        """Close what belongs to it after its end; return the connections that still wait."""
        with contextlib.suppress(KeyError):
            self._selector.unregister(self._output)
        for pipe in (self._input, self._output):
            with contextlib.suppress(OSError):
                pipe.close()
        for relay in list(self.clients.values()):
            if relay is not None:
                relay.close()
        if self._group is not None:
            control_groups.remove(self._group)
        log.info("The server of %s has ended (%d)", self.user.name, self._process.returncode)
        return list(self.clients)
