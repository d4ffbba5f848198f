"""One client's connection: reads its requests and sends the responses, in a thread of its own."""

from __future__ import annotations

import contextlib
import email.utils
import io
import os
import socket
import struct
import time
from functools import lru_cache
from http import HTTPStatus

from httptools import HttpParserError

from gym_server.budget import Share
from gym_server.http_server.interface import Application
from gym_server.http_server.request_parser import Request, RequestParser
from gym_server.response import Response

# The longest that a connection may be idle, in seconds.
_IDLE_SECONDS = 3600.0

# A client may pause this long, in seconds, while it sends a request or reads a response. Overall it
# must move at least this many bytes a second.
_REST_SECONDS = 60.0
_SLOWEST_BYTES = 1000

# How long a client that is not recognized may use the connection, in seconds, whatever it does.
# Longer than the proxy of inst/examples/nginx.conf keeps an idle connection.
_UNRECOGNIZED_SECONDS = 20.0

# When a response has been unread for this long, the client is slow and not the network.
_UNREAD_SECONDS = 1.0

# The header of responses that need not be delivered after the server has stopped.
_NO_STORE = ("Cache-Control", "no-store")

_RECEIVE_BYTES = 2**16

# Bodies up to this size are copied behind their head, to send both in one piece.
_COPIED_BYTES = 2**16

# How much of a response the system buffers beyond what is in flight. It takes more when half of
# that is gone, so even the slowest reader allowed is seen to read within half a minute.
_UNSENT_BYTES = 2**16

# With this option, closing a socket discards unread data instead of keeping it for minutes.
_DISCARD_UNREAD = struct.pack("hh" if os.name == "nt" else "ii", 1, 0)


class _Pace:
    """How long to wait for the next part of a request or response.

    A client that sends or reads byte by byte is treated like one that does nothing.
    """

    def __init__(self) -> None:
        """Start the clock."""
        self._due = time.monotonic() + _REST_SECONDS

    def left(self, moved: int) -> float:
        """Return how many seconds the next part may take.

        Args:
            moved: the bytes sent or received since the last call.

        Raises:
            TimeoutError: the client is too slow.
        """
        self._due += moved / _SLOWEST_BYTES
        left = min(_REST_SECONDS, self._due - time.monotonic())
        if left <= 0:
            raise TimeoutError("a request comes, or an answer is read, too slowly")
        return left


class Connection:
    """Serves the requests of one socket, one after another."""

    def __init__(
        self,
        client: socket.socket,
        app: Application,
        base_environ: dict,
        max_body_bytes: int,
        bodies: Share,
    ) -> None:
        """Take over a connected socket.

        Args:
            client: the socket.
            app: the application.
            base_environ: the entries that the environ of every request shares.
            max_body_bytes: the size of the largest body.
            bodies: the memory that large bodies hold until they are answered.
        """
        self._socket = client
        self._app = app
        self._base_environ = base_environ
        self._parser = RequestParser(max_body_bytes, self._send, self._refusal, bodies, app.refuse)
        self._is_recognized = False
        # The deadline for being recognized, in the clock's seconds.
        self._due = time.monotonic() + _UNRECOGNIZED_SECONDS
        self._last: Request | None = None
        self._last_environ: dict = {}
        self._stopping = False
        # Whether it is working on a request rather than waiting for its client.
        self._busy = False
        # The size of the response that is being sent, as the only item of a list. Two threads may
        # call list.pop(): the serving thread when everything is sent, and the thread that evicts
        # this connection because the response is not read. It succeeds in only one of them.
        self._sending: list[int] = []
        # Whether the response being sent need not be delivered after a stop.
        self._sends_no_store = False
        # Since when it has been waiting for its client, in the clock's seconds.
        self.waiting_since = time.monotonic()

    @property
    def unsent_bytes(self) -> int:
        """The size of the response that its client has not yet read."""
        return sum(self._sending)

    def _wait_at_most(self, seconds: float) -> None:
        """Set how long the socket may take to send or receive the next part."""
        if not self._is_recognized:
            seconds = min(seconds, self._due - time.monotonic())
            if seconds <= 0:
                raise TimeoutError("a client that is not recognized has no more time")
        self._socket.settimeout(seconds)

    def serve(self) -> None:
        """Answer requests until the client leaves, is silent for too long, or the server stops."""
        # A client that has left needs no response, so socket errors are ignored.
        with contextlib.suppress(OSError), contextlib.closing(self._parser), self._socket:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if hasattr(socket, "TCP_NOTSENT_LOWAT"):
                self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, _UNSENT_BYTES)
            self._wait_at_most(_REST_SECONDS)
            rest: _Pace | None = None
            while data := self._receive():
                self._busy = True
                requests = self._parser.feed(data)
                if not all(map(self._answer, requests)):
                    break
                if not requests:
                    self.waiting_since = time.monotonic()
                self._busy = False
                if not self._parser.began:
                    # For a recognized client the timeout is already set.
                    if rest is not None or not self._is_recognized:
                        self._wait_at_most(_REST_SECONDS)
                    rest = None
                    continue
                if requests or rest is None:
                    rest = _Pace()
                self._wait_at_most(rest.left(len(data)))

    def _receive(self) -> bytes:
        while True:
            try:
                return self._socket.recv(_RECEIVE_BYTES)
            except TimeoutError:
                silent = time.monotonic() - self.waiting_since
                if self._parser.began or not self._is_recognized or silent > _IDLE_SECONDS:
                    raise

    def _refusal(self, request: Request) -> Response | None:
        """Return a response that refuses a request before its large body arrives, or None."""
        try:
            environ = {**self._base_environ, **request.environ()}
        except HttpParserError as error:
            return self._app.refuse(400, str(error))
        refusal = self._app.admit(environ)
        if refusal is None and not self._is_recognized:
            self._recognize(environ)
        return refusal

    def _recognize(self, environ: dict) -> None:
        if self._app.recognizes(environ):
            self._is_recognized = True
            self._wait_at_most(_REST_SECONDS)

    def _answer(self, request: Request) -> bool:
        """Answer one request; return whether another may follow."""
        response = self._respond(request)
        if request.held_bytes:
            self._parser.release(request)
        keep = request.keep_alive and self._is_recognized and not self._stopping
        # The connection may be one that a proxy shares among clients with servers of their own.
        keep = keep and response.status != HTTPStatus.UNAUTHORIZED
        self._sends_no_store = _NO_STORE in response.headers
        head, body = _head(response, keep), b"" if request.method == "HEAD" else response.body
        # One send() where the copy is cheap: a second one would arrive later.
        if len(body) <= _COPIED_BYTES:
            self._send(head + body)
        else:
            self._send(head, body)
        self._sends_no_store = False
        if response.take_over is not None:
            self._busy = False
            self._socket.settimeout(None)
            response.take_over(self._socket, request.rest)
        return keep

    def _send(self, data: bytes, more: bytes = b"") -> None:
        """Send everything to a client that keeps reading."""
        self.waiting_since = time.monotonic()
        self._sending.append(len(data) + len(more))
        try:
            sent = self._socket.send(data)
            if more or sent < len(data):
                self._send_rest(sent, memoryview(data)[sent:], memoryview(more))
            self._sending.pop()
        except (OSError, IndexError) as error:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _DISCARD_UNREAD)
            raise ConnectionAbortedError("an answer was not read") from error

    def _send_rest(self, sent: int, *parts: memoryview) -> None:
        pace = _Pace()
        for part in parts:
            while part:
                self._wait_at_most(pace.left(sent))
                sent = self._socket.send(part)
                part = part[sent:]
                self.waiting_since = time.monotonic()
        self._wait_at_most(_REST_SECONDS)

    def _respond(self, request: Request) -> Response:
        if request.refusal is not None:
            return request.refusal
        # A client that plays sends the same head with every step.
        if self._last is None or not request.same_head(self._last):
            try:
                self._last_environ = {**self._base_environ, **request.environ()}
            except HttpParserError as error:
                return self._app.refuse(400, str(error))
            self._last = request
        body = bytes(request.body)
        request.body = b""
        environ = {
            **self._last_environ,
            "CONTENT_LENGTH": str(len(body)),
            "wsgi.input": io.BytesIO(body),
            "gym_server.is_connected": self._is_connected,
        }
        if not self._is_recognized:
            self._recognize(environ)
        return self._app.respond(environ)

    def _is_connected(self) -> bool:
        """Return whether the client's end is still open; called by the serving thread."""
        seconds = self._socket.gettimeout()
        try:
            self._socket.settimeout(0)
            return self._socket.recv(1, socket.MSG_PEEK) != b""
        except BlockingIOError:
            return True
        except OSError:
            return False
        finally:
            with contextlib.suppress(OSError):
                self._socket.settimeout(seconds)

    def eviction_rank(self, now: float) -> tuple[int, float] | None:
        """Return a key to sort connections for eviction, smallest first; None if not evictable.

        Connections of unrecognized clients come first, then those whose client does not read its
        response, then idle ones. Among equals, the one that has waited longest is first.

        Args:
            now: the clock's seconds.
        """
        is_slow = now > self.waiting_since + _UNREAD_SECONDS
        if self._busy and not (self._sending and is_slow):
            return None
        # The client of a new connection may soon be recognized.
        is_foreign = is_slow and not self._is_recognized
        return (0 if is_foreign else 1 if self._busy else 2), self.waiting_since

    def evict(self) -> bool:
        """End the connection if it is only waiting for its client; return whether it did."""
        how = socket.SHUT_RD
        if self._busy:
            try:
                self._sending.pop()
            except IndexError:
                return False
            how = socket.SHUT_RDWR
        with contextlib.suppress(OSError):
            # A request that an idle client has just sent is still answered.
            self._socket.shutdown(how)
        return True

    def stop(self, half_sent: bool) -> None:
        """Make ``serve()`` end once it has answered the requests that have arrived.

        Args:
            half_sent: whether to drop requests that have only partly arrived, and unread
                responses that need not be delivered.
        """
        self._stopping = True
        if self._busy and self._sends_no_store and half_sent:
            with contextlib.suppress(OSError):
                self._socket.shutdown(socket.SHUT_RDWR)
        if not self._busy and (half_sent or not self._parser.began):
            with contextlib.suppress(OSError):
                self._socket.shutdown(socket.SHUT_RD)


# In capitals, as in Flask's responses, and as classic clients show them.
_STATUS_LINES = {one.value: f"HTTP/1.1 {one.value} {one.phrase.upper()}" for one in HTTPStatus}
_NO_CONTENT = HTTPStatus.NO_CONTENT.value
_SWITCHING = HTTPStatus.SWITCHING_PROTOCOLS.value


def _head(response: Response, keep: bool) -> bytes:
    """Return the status line and headers."""
    head = f"{_STATUS_LINES[response.status]}\r\n"
    if response.status != _SWITCHING:
        head += f"Content-Type: {response.content_type}\r\n"
        if response.status != _NO_CONTENT:
            head += f"Content-Length: {len(response.body)}\r\n"
    for name, value in response.headers:
        head += f"{name}: {value}\r\n"
    head += f"Date: {_date(int(time.time()))}\r\n"
    if not keep and response.status != _SWITCHING:
        head += "Connection: close\r\n"
    return f"{head}\r\n".encode("latin-1")


@lru_cache(maxsize=2)
def _date(second: int) -> str:
    return email.utils.formatdate(second, usegmt=True)
