"""One client's connection: its requests come in, their answers go out, in a thread of its own.

WSGI calls the application.
"""

from __future__ import annotations

import contextlib
import email.utils
import io
import socket
import sys
import threading
import time
from collections.abc import Callable
from functools import lru_cache
from http import HTTPStatus

from httptools import HttpParserError

from gym_server import wire
from gym_server.errors import GymServerError, answer_to
from gym_server.request_reader import Reader, Request, malformed

# Seconds that a connection may be idle, and that the next bytes of a begun request may take.
_IDLE_SECONDS = 3600.0
_REST_SECONDS = 60.0

# For the answer of a thread that is stuck.
_LAST_WORD_SECONDS = 1.0
# And how many a second must come of it, on the whole.
_SLOWEST_BYTES = 1000

# The header of answers that are worth nothing later.
_NOT_KEPT = ("Cache-Control", "no-store")

_RECEIVE_BYTES = 2**16


class Connection:
    """Serves the requests of one socket, one after the other."""

    def __init__(
        self,
        client: socket.socket,
        app: Callable,
        base_environ: dict,
        max_body_bytes: int,
        admit: Callable[[dict], None] = lambda environ: None,
    ) -> None:
        """Take over a connected socket.

        Args:
            client: the socket.
            app: a WSGI application.
            base_environ: what is the same in the environment of each request.
            max_body_bytes: the size of the largest body.
            admit: is shown what WSGI would be, before a large body is read, and raises what the
                request is refused with.
        """
        self._socket = client
        self._app = app
        self._base_environ = base_environ
        self._reader = Reader(max_body_bytes, client.sendall, self._why_not)
        self._admit = admit
        self._last: Request | None = None
        self._last_environ: dict = {}
        self._stopping = False
        self._answering = False
        # When the rest of a begun request must be there.
        self._due = 0.0
        # Whether what is sent is of this moment only.
        self._passing = False
        # The request that wants an answer. Whoever takes it out, which only one thread can, is
        # the one to send it.
        self._owed: list[Request] = []
        # Who serves it, and since when it has waited for its client, in the clock's seconds.
        self.thread = 0
        self.silent_since = time.monotonic()

    def serve(self) -> None:
        """Answer until the client leaves, is silent for too long, or the server stops."""
        # Whoever is not there any more needs no answer.
        self.thread = threading.get_ident()
        with contextlib.suppress(OSError), self._socket:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._socket.settimeout(_IDLE_SECONDS)
            in_part = False
            while data := self._socket.recv(_RECEIVE_BYTES):
                self._answering = True
                requests = self._reader.feed(data)
                if not self._answer_all(requests):
                    break
                self.silent_since = time.monotonic()
                self._answering = False
                if self._reader.began or in_part:
                    left = self._rest_seconds(len(data), anew=bool(requests) or not in_part)
                    in_part = self._reader.began
                    self._socket.settimeout(left if in_part else _IDLE_SECONDS)

    def _rest_seconds(self, received: int, anew: bool) -> float:
        """Return how long the rest of a request that has come in part may let wait for itself.

        Whoever sends it drop by drop is no better than who sends nothing.
        """
        now = time.monotonic()
        if anew:
            self._due = now + _REST_SECONDS
        self._due += received / _SLOWEST_BYTES
        left = min(_REST_SECONDS, self._due - now)
        if left <= 0:
            raise TimeoutError("a request comes too slowly")
        return left

    def _why_not(self, request: Request) -> GymServerError | None:
        try:
            self._admit({**self._base_environ, **request.environ()})
        except GymServerError as refusal:
            return refusal
        except HttpParserError as error:
            return malformed(str(error))
        return None

    def _answer_all(self, requests: list[Request]) -> bool:
        return all(map(self._answer, requests))

    def _answer(self, request: Request) -> bool:
        """Answer one request; return whether another may follow."""
        self._owed.append(request)
        status, headers, body = self._respond(request)
        try:
            self._owed.pop()
        except IndexError:
            # It took so long that somebody else has answered.
            return False
        keep = request.keep_alive and not self._stopping
        self._passing = _NOT_KEPT in headers
        # In one piece: a body that follows its header is held back until that is acknowledged.
        self._socket.sendall(_head(status, headers, keep) + body)
        self._passing = False
        return keep

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
        with contextlib.suppress(OSError), self._socket:
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
        body = b"".join(request.body)
        request.body.clear()
        return {
            **self._last_environ,
            "CONTENT_LENGTH": str(len(body)),
            "wsgi.input": io.BytesIO(body),
            "wsgi.errors": sys.stderr,
        }

    def give_way(self) -> bool:
        """Leave, if nothing but the client is waited for; return whether that is so."""
        if self._answering:
            return False
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RD)
        return True

    def stop(self, half_sent: bool) -> None:
        """Make ``serve()`` end when the requests that have arrived are answered.

        Args:
            half_sent: whether to give up a request of which only a part has arrived, and an
                answer that nobody would keep and its client does not read.
        """
        self._stopping = True
        if self._answering and self._passing and half_sent:
            # A watcher that does not read what it asked for.
            with contextlib.suppress(OSError):
                self._socket.shutdown(socket.SHUT_RDWR)
        if not self._answering and (half_sent or not self._reader.began):
            with contextlib.suppress(OSError):
                self._socket.shutdown(socket.SHUT_RD)


def _refuse(refusal: GymServerError) -> tuple[str, list[tuple[str, str]], bytes]:
    status, body = answer_to(refusal)
    data = wire.dumps(body)
    headers = [
        ("Content-Type", wire.JSON),
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
