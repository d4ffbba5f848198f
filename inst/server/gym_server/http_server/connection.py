"""One client's connection: its requests come in, their answers go out, in a thread of its own.

WSGI calls the application.
"""

from __future__ import annotations

import contextlib
import email.utils
import io
import os
import socket
import struct
import sys
import threading
import time
from collections.abc import Callable
from functools import lru_cache
from http import HTTPStatus

from httptools import HttpParserError

from gym_server.budget import Share
from gym_server.errors import GymServerError, answer_to
from gym_server.http_server.request_parser import Reader, Request, malformed
from gym_server.protocol import answers

# Seconds that a connection may be idle.
_IDLE_SECONDS = 3600.0

# Seconds that nothing may come of a begun request, and that nothing may be read of an answer;
# and how many bytes a second there must be beyond that, on the whole.
_REST_SECONDS = 60.0
_SLOWEST_BYTES = 1000

# Seconds for both, and for being idle, for those who have not shown that they belong here. Longer
# than the proxy of inst/examples/nginx.conf keeps a connection that is idle.
_STRANGER_SECONDS = 20.0

# An answer that was not read for so long waits for its client, and not for the network.
_STUCK_SECONDS = 1.0

# For the answer of a thread that is stuck.
_LAST_WORD_SECONDS = 1.0

# The header of answers that are worth nothing later.
_NOT_KEPT = ("Cache-Control", "no-store")

_RECEIVE_BYTES = 2**16

# An answer's body that is copied behind its head, so that both go in one piece.
_COPIED_BYTES = 2**16

# What the system takes of an answer beyond what is on its way. It takes more when half of that is
# gone: so it is seen within half a minute that a client reads as slowly as it may.
_UNSENT_BYTES = 2**16

# Closing then forgets what was not read; the system would keep it for minutes.
_FORGET_UNREAD = struct.pack("hh" if os.name == "nt" else "ii", 1, 0)


class _Pace:
    """How long one may wait for the rest of what comes or goes in parts.

    Whoever sends or reads drop by drop is no better than who does nothing.
    """

    def __init__(self, seconds: float) -> None:
        """Begin now.

        Args:
            seconds: that nothing may move.
        """
        self._seconds = seconds
        self._due = time.monotonic() + seconds

    def left(self, moved: int) -> float:
        """Return how many seconds the next part may take.

        Args:
            moved: how many bytes have come or gone since the last call.

        Raises:
            TimeoutError: it is too slow.
        """
        self._due += moved / _SLOWEST_BYTES
        left = min(self._seconds, self._due - time.monotonic())
        if left <= 0:
            raise TimeoutError("a request comes, or an answer is read, too slowly")
        return left


class Connection:
    """Serves the requests of one socket, one after the other."""

    def __init__(
        self,
        client: socket.socket,
        app: Callable,
        base_environ: dict,
        max_body_bytes: int,
        bodies: Share,
        admit: Callable[[dict], None] = lambda environ: None,
        knows: Callable[[dict], bool] = lambda environ: True,
    ) -> None:
        """Take over a connected socket.

        Args:
            client: the socket.
            app: a WSGI application.
            base_environ: what is the same in the environment of each request.
            max_body_bytes: the size of the largest body.
            bodies: what large bodies may hold until they are answered.
            admit: is shown what WSGI would be, before a large body is read, and raises what the
                request is refused with.
            knows: is shown the same, and tells whether its client may stay connected; asked
                until it does. Others get one answer and have less time.
        """
        self._socket = client
        self._app = app
        self._base_environ = base_environ
        self._reader = Reader(max_body_bytes, self._send, self._why_not, bodies)
        self._admit = admit
        self._knows = knows
        self._known = False
        self._last: Request | None = None
        self._last_environ: dict = {}
        self._stopping = False
        # Whether it works, and does not wait for its client.
        self._busy = False
        # The size of the answer that is being sent meanwhile. Whoever takes it out, which only one
        # thread can, decides whether the connection goes on after it.
        self._sending: list[int] = []
        # Whether what is sent is of this moment only.
        self._passing = False
        # The request that wants an answer. Whoever takes it out, which only one thread can, is
        # the one to send it.
        self._owed: list[Request] = []
        # Who serves it.
        self.thread = 0
        # Since when it has waited for its client, in the clock's seconds.
        self.waiting_since = time.monotonic()

    @property
    def unsent_bytes(self) -> int:
        """The size of the answer that its client has not read to the end."""
        return sum(self._sending)

    @property
    def _seconds(self) -> float:
        return _REST_SECONDS if self._known else _STRANGER_SECONDS

    def serve(self) -> None:
        """Answer until the client leaves, is silent for too long, or the server stops."""
        # Whoever is not there any more needs no answer.
        self.thread = threading.get_ident()
        with contextlib.suppress(OSError), contextlib.closing(self._reader), self._socket:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if hasattr(socket, "TCP_NOTSENT_LOWAT"):
                self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, _UNSENT_BYTES)
            self._socket.settimeout(self._seconds)
            rest: _Pace | None = None
            while data := self._receive():
                self._busy = True
                requests = self._reader.feed(data)
                if not self._answer_all(requests):
                    break
                if not requests:
                    self.waiting_since = time.monotonic()
                self._busy = False
                if not self._reader.began:
                    if rest is not None:
                        self._socket.settimeout(self._seconds)
                    rest = None
                    continue
                if requests or rest is None:
                    rest = _Pace(self._seconds)
                self._socket.settimeout(rest.left(len(data)))

    def _receive(self) -> bytes:
        while True:
            try:
                return self._socket.recv(_RECEIVE_BYTES)
            except TimeoutError:
                silent = time.monotonic() - self.waiting_since
                if self._reader.began or not self._known or silent > _IDLE_SECONDS:
                    raise

    def _why_not(self, request: Request) -> GymServerError | None:
        try:
            environ = {**self._base_environ, **request.environ()}
            self._admit(environ)
            if not self._known:
                self._meet(environ)
        except GymServerError as refusal:
            return refusal
        except HttpParserError as error:
            return malformed(str(error))
        return None

    def _meet(self, environ: dict) -> None:
        if self._knows(environ):
            self._known = True
            self._socket.settimeout(self._seconds)

    def _answer_all(self, requests: list[Request]) -> bool:
        return all(map(self._answer, requests))

    def _answer(self, request: Request) -> bool:
        """Answer one request; return whether another may follow."""
        self._owed.append(request)
        status, headers, body = self._respond(request)
        if request.held_bytes:
            self._reader.release(request)
        try:
            self._owed.pop()
        except IndexError:
            # It took so long that somebody else has answered.
            return False
        keep = request.keep_alive and self._known and not self._stopping
        self._passing = _NOT_KEPT in headers
        # In one piece, where that is not much to copy: what follows the head would come later.
        if len(body) <= _COPIED_BYTES:
            self._send(_head(status, headers, keep) + body)
        else:
            self._send(_head(status, headers, keep), body)
        self._passing = False
        return keep

    def _send(self, data: bytes, more: bytes = b"") -> None:
        """Send all of it to a client that reads it, however slowly within reason."""
        self.waiting_since = time.monotonic()
        self._sending.append(len(data) + len(more))
        try:
            sent = self._socket.send(data)
            if more or sent < len(data):
                self._send_rest(sent, memoryview(data)[sent:], memoryview(more))
            self._sending.pop()
        except (OSError, IndexError) as error:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _FORGET_UNREAD)
            raise ConnectionAbortedError("an answer was not read") from error

    def _send_rest(self, sent: int, *parts: memoryview) -> None:
        pace = _Pace(self._seconds)
        for part in parts:
            while part:
                self._socket.settimeout(pace.left(sent))
                sent = self._socket.send(part)
                part = part[sent:]
                self.waiting_since = time.monotonic()
        self._socket.settimeout(self._seconds)

    def answer_for(self, status: str, headers: list[tuple[str, str]], body: bytes) -> None:
        """Answer on behalf of the thread that serves it and is stuck; then leave.

        Args:
            status: as for WSGI.
            headers: as for WSGI.
            body: what follows them.
        """
        try:
            request = self._owed.pop()
        except IndexError:
            # It has just come back.
            return
        with contextlib.suppress(OSError), contextlib.closing(self._reader), self._socket:
            self._socket.settimeout(_LAST_WORD_SECONDS)
            data = b"" if request.method == "HEAD" else body
            self._socket.sendall(_head(status, headers, keep=False) + data)
            self._socket.shutdown(socket.SHUT_WR)

    def _respond(self, request: Request) -> tuple[str, list[tuple[str, str]], bytes]:
        if request.refusal is not None:
            return _refuse(request.refusal)
        try:
            environ = self._environ(request)
        except HttpParserError as error:
            return _refuse(malformed(str(error)))
        if not self._known:
            self._meet(environ)
        started: list = []
        result = self._app(
            environ,
            lambda status, headers, exc_info=None: started.extend((status, headers)),
        )
        try:
            body = b"".join(result)
        finally:
            if hasattr(result, "close"):
                result.close()
        return started[0], started[1], b"" if request.method == "HEAD" else body

    def _environ(self, request: Request) -> dict:
        # A client that plays says the same words in each step.
        if not (self._last is not None and request.same_head(self._last)):
            self._last, self._last_environ = request, {**self._base_environ, **request.environ()}
        body = bytes(request.body)
        request.body = b""
        return {
            **self._last_environ,
            "CONTENT_LENGTH": str(len(body)),
            "wsgi.input": io.BytesIO(body),
            "wsgi.errors": sys.stderr,
        }

    def turn_to_leave(self, now: float) -> tuple[int, float] | None:
        """Return what is the smaller, the sooner it is to leave for others; None: not now.

        First those who have not shown that they belong here, then those who do not read their
        answers, then those who are silent; of each kind those first who were waited for longest.

        Args:
            now: the clock's seconds.
        """
        stuck = now > self.waiting_since + _STUCK_SECONDS
        if self._busy and not (self._sending and stuck):
            return None
        # A new one may have been heard in a moment.
        stranger = stuck and not self._known
        return (0 if stranger else 1 if self._busy else 2), self.waiting_since

    def give_way(self) -> bool:
        """Leave, if nothing but the client is waited for; return whether that is so."""
        how = socket.SHUT_RD
        if self._busy:
            try:
                self._sending.pop()
            except IndexError:
                return False
            how = socket.SHUT_RDWR
        with contextlib.suppress(OSError):
            # Of a silent one what has arrived in this moment is answered still.
            self._socket.shutdown(how)
        return True

    def stop(self, half_sent: bool) -> None:
        """Make ``serve()`` end when the requests that have arrived are answered.

        Args:
            half_sent: whether to give up a request of which only a part has arrived, and an
                answer that nobody would keep and its client does not read.
        """
        self._stopping = True
        if self._busy and self._passing and half_sent:
            # A watcher that does not read what it asked for.
            with contextlib.suppress(OSError):
                self._socket.shutdown(socket.SHUT_RDWR)
        if not self._busy and (half_sent or not self._reader.began):
            with contextlib.suppress(OSError):
                self._socket.shutdown(socket.SHUT_RD)


def _refuse(refusal: GymServerError) -> tuple[str, list[tuple[str, str]], bytes]:
    status, body = answer_to(refusal)
    data = answers.dumps(body)
    headers = [
        ("Content-Type", answers.JSON),
        ("Content-Length", str(len(data))),
        *refusal.headers,
    ]
    return f"{status} {HTTPStatus(status).phrase}", headers, data


def _head(status: str, headers: list[tuple[str, str]], keep: bool) -> bytes:
    """Return what comes before the body."""
    head = [f"HTTP/1.1 {status}"]
    head += [f"{name}: {value}" for name, value in headers]
    head.append(f"Date: {_date(int(time.time()))}")
    if not keep:
        head.append("Connection: close")
    head.append("\r\n")
    return "\r\n".join(head).encode("latin-1")


@lru_cache(maxsize=2)
def _date(second: int) -> str:
    return email.utils.formatdate(second, usegmt=True)
