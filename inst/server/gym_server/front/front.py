"""The front: one loop that accepts connections, finds their users, and hands them over."""

from __future__ import annotations

import contextlib
import errno
import logging
import signal
import socket
import time
from selectors import EVENT_READ, DefaultSelector

from gym_server.front import answers
from gym_server.front.request_head import LARGEST_BYTES, BadHeadError, RequestHead, read_head
from gym_server.front.starts import Starts
from gym_server.front.user_server import MOST_WAITING, Client, UserServer
from gym_server.front.users_file import User, UsersFile
from gym_server.tokens import CannotStartError

log = logging.getLogger(__name__)

# How long a connection may take to show a token, in seconds, and how many may be about to.
_SHOW_SECONDS = 20.0
_MOST_NEWCOMERS = 1000

# How often servers, files and times are looked at, in seconds.
_TICK_SECONDS = 1.0

# How long to wait for others to close files when no more may be opened, in seconds.
_FULL_SECONDS = 0.2

# Room for the largest answer of the front in a socket's buffer.
_ANSWER_BYTES = 2**18


class _Newcomer:
    """A connection that has not shown a token, or was refused and has not left yet."""

    def __init__(self, sock: socket.socket) -> None:
        self.socket = sock
        self.seen = 0
        self.is_refused = False
        self.due = time.monotonic() + _SHOW_SECONDS


class Front:
    """Serves the users of a file, each by a server of their own.

    Attributes:
        port: the port that it listens on.
    """

    def __init__(self, listener: socket.socket, users: UsersFile, starts: Starts) -> None:
        """Prepare to serve; ``run()`` starts.

        Args:
            listener: a listening socket.
            users: the users.
            starts: decides how their servers are started.
        """
        self._listener = listener
        self.port: int = listener.getsockname()[1]
        self._users = users
        self._starts = starts
        self._selector = DefaultSelector()
        # The oldest is first.
        self._newcomers: dict[_Newcomer, None] = {}
        self._servers: dict[str, UserServer] = {}
        self._is_stopping = False
        self._tick_at = 0.0
        self._wake, self._waker = socket.socketpair()
        self._waker.setblocking(False)

    def stop(self) -> None:
        """Ask ``run()`` to end; may be called from any thread or signal handler."""
        self._is_stopping = True
        with contextlib.suppress(OSError):
            self._waker.send(b"x")

    def run(self) -> None:
        """Serve until ``stop()`` is called, then end the users' servers."""
        signal.signal(signal.SIGCHLD, lambda *_: None)
        signal.set_wakeup_fd(self._waker.fileno(), warn_on_full_buffer=False)
        self._listener.setblocking(False)
        self._selector.register(self._wake, EVENT_READ, self._note_wake)
        self._selector.register(self._listener, EVENT_READ, self._accept)
        while self._servers or not self._is_stopping:
            for key, events in self._selector.select(_TICK_SECONDS):
                try:
                    key.data(events)
                except Exception:
                    # It concerns one connection, and all users are here.
                    log.exception("A connection failed because of a bug in the front")
            if time.monotonic() >= self._tick_at:
                self._tick_at = time.monotonic() + _TICK_SECONDS
                self._tick()
        self._starts.close()

    def _note_wake(self, events: int) -> None:
        self._wake.recv(4096)
        self._tick_at = 0.0

    def _tick(self) -> None:
        if self._is_stopping:
            if self._listener.fileno() >= 0:
                self._selector.unregister(self._listener)
                self._listener.close()
            for server in self._servers.values():
                server.end()
        while self._newcomers and next(iter(self._newcomers)).due < time.monotonic():
            self._drop(next(iter(self._newcomers)))
        if self._users.read_again():
            for server in self._servers.values():
                if server.user not in self._users.users:
                    server.end()
        for server in list(self._servers.values()):
            if server.has_ended():
                self._replace(server)

    def _replace(self, server: UserServer) -> None:
        """Forget a server that has ended; start another if somebody waits for it."""
        del self._servers[server.user.name]
        for client in server.clean_up():
            if server.has_started and not self._is_stopping:
                self._enter(client)
            else:
                self._refuse(client.socket, answers.unavailable())

    # Newcomers ---------------------------------------------------------------------------------

    def _accept(self, events: int) -> None:
        try:
            client, _ = self._listener.accept()
        except OSError as error:
            if error.errno in (errno.EMFILE, errno.ENFILE):
                log.warning("No more connections: this process may open no more files")
                # Who has a server already does not wait for this.
                time.sleep(_FULL_SECONDS)
            return  # Otherwise the client has already left.
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        self._welcome(_Newcomer(client))

    def _welcome(self, newcomer: _Newcomer) -> None:
        if len(self._newcomers) >= _MOST_NEWCOMERS:
            self._drop(next(iter(self._newcomers)))
        self._newcomers[newcomer] = None
        self._selector.register(
            newcomer.socket, EVENT_READ, lambda events: self._read_from(newcomer)
        )

    def _drop(self, newcomer: _Newcomer) -> None:
        self._let_go(newcomer)
        newcomer.socket.close()

    def _let_go(self, newcomer: _Newcomer) -> None:
        del self._newcomers[newcomer]
        self._selector.unregister(newcomer.socket)

    def _read_from(self, newcomer: _Newcomer) -> None:
        # Another connection's event may just have closed this one.
        if newcomer not in self._newcomers:
            return
        # The user's server reads the request, too.
        flags = 0 if newcomer.is_refused else socket.MSG_PEEK
        try:
            data = newcomer.socket.recv(2 * LARGEST_BYTES, flags)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if len(data) <= newcomer.seen:
            self._drop(newcomer)
        elif not newcomer.is_refused:
            newcomer.seen = len(data)
            self._read_head_of(newcomer, data)

    def _read_head_of(self, newcomer: _Newcomer, data: bytes) -> None:
        try:
            head = read_head(data)
        except BadHeadError as error:
            self._let_go(newcomer)
            self._refuse(newcomer.socket, answers.malformed(str(error)))
            return
        # What was seen is no news.
        least = newcomer.seen + 1 if head is None else 1
        newcomer.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVLOWAT, least)
        if head is not None:
            self._let_go(newcomer)
            self._enter(Client(newcomer.socket, head))

    def _refuse(self, sock: socket.socket, answer: bytes) -> None:
        """Send the only answer of a connection, and read until its client leaves.

        Closing it at once would discard the answer if the client still sends.
        """
        newcomer = _Newcomer(sock)
        newcomer.is_refused = True
        self._welcome(newcomer)
        try:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVLOWAT, 1)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _ANSWER_BYTES)
            sock.send(answer)
            sock.shutdown(socket.SHUT_WR)
        except OSError:
            self._drop(newcomer)

    # Users -------------------------------------------------------------------------------------

    def _enter(self, client: Client) -> None:
        """Hand a connection over to the server of its token or key; refuse it if there is none."""
        head = client.head
        user = None if head.token is None else self._users.find(head.token)
        try:
            server = self._watched(head.key) if user is None else self._server_of(user, head)
            if server is not None and len(server.waiting) < MOST_WAITING:
                server.add(client)
                return
        except (OSError, CannotStartError) as error:
            log.warning("A user's server cannot be started: %s", error)
            server = None
        self._refuse(client.socket, self._why_not(head, user, server))

    def _server_of(self, user: User, head: RequestHead) -> UserServer | None:
        """Return the running server of a user; start it if there is none."""
        server = self._servers.get(user.name)
        if server is None and not self._is_stopping:
            start = self._starts.of(user.name, len(self._users.users))
            server = UserServer(self._selector, user, head.token or b"", start)
            self._servers[user.name] = server
        return server

    def _watched(self, key: str) -> UserServer | None:
        """Return the running server whose watch pages have keys like this one."""
        route = key.partition(".")[0]
        for server in self._servers.values():
            if server.route == route and not server.is_ending:
                return server
        return None

    def _why_not(self, head: RequestHead, user: User | None, server: UserServer | None) -> bytes:
        if server is not None:
            return answers.too_many_connections(MOST_WAITING)
        if user is not None:
            return answers.unavailable()
        page_file = answers.page_file(head.path) if head.method == "GET" else None
        return page_file or answers.unauthorized()
