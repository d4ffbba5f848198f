"""One client's connection: reads its requests and sends the responses, in a thread of its own."""

from __future__ import annotations

import contextlib
import email.utils
import math
import re
import socket
import time
from collections.abc import Callable
from enum import Enum
from functools import lru_cache
from http import HTTPStatus
from typing import NamedTuple, Protocol

from httptools import HttpParserError

from gym_server.http_server.head import MOST_BYTES, RequestHead
from gym_server.response import Admission, Response

# How long a client may use the connection before it is known, in seconds, whatever it does. Longer
# than the proxy of inst/examples/nginx.conf keeps an idle connection.
_UNKNOWN_SECONDS = 20.0

# How long a known client may be silent, or take to read a response, in seconds.
_IDLE_SECONDS = 3600.0

# The largest body of a client whose admission does not last.
_UNTRUSTED_BODY_BYTES = 2**16

# How much a client may still send after a refusal, so that it sees the response, and how long it
# may pause.
_DISCARD_BYTES = 2**30
_DISCARD_SECONDS = 5.0

_RECEIVE_BYTES = 2**16

# Bodies up to this size are copied behind their head, to send both in one piece.
_COPIED_BYTES = 2**16

# A client that plays sends the same few heads again and again. This many of at most this size are
# remembered.
_MOST_HEADS = 16
_LONGEST_HEAD = 4096

_CHUNK_SIZE = re.compile(rb"([0-9A-Fa-f]{1,15})(?:;.*)?\r\n")
_MOST_TRAILERS = 100


class Application(Protocol):
    """Makes the responses. A request's head is given as a WSGI environ."""

    def admit(self, environ: dict) -> Admission | Response:
        """Say how to answer a request before its body is read, or refuse it."""

    def refuse(self, status: int, reason: str) -> Response:
        """Answer bytes that are not a request: 400 with a reason, or 413."""

    def begin_stop(self) -> None:
        """End requests soon that would otherwise wait for longer than the stop takes."""


class _Phase(Enum):
    """What a connection does: wait for a request, receive its rest, answer it, or serve a route."""

    IDLE = 1
    RECEIVING = 2
    ANSWERING = 3
    TAKEN_OVER = 4


class _Known(NamedTuple):
    """A head that was read and admitted."""

    head: RequestHead
    admission: Admission


class _RefusedError(Exception):
    """Ends the connection with a response."""

    def __init__(self, response: Response, with_body: bool = True) -> None:
        super().__init__()
        self.response = response
        self.with_body = with_body


class Connection:
    """Serves the requests of one socket, one after another.

    Attributes:
        is_known: whether its client has shown that it may stay connected.
        heard: when it was opened or its last request began, in the clock's seconds.
    """

    def __init__(
        self, client: socket.socket, app: Application, base_environ: dict, max_body_bytes: int
    ) -> None:
        """Take over a connected socket.

        Args:
            client: the socket.
            app: the application.
            base_environ: the entries that the environ of every request shares.
            max_body_bytes: the size of the largest body.
        """
        self._socket = client
        self._app = app
        self._base_environ = base_environ
        self._max_body_bytes = max_body_bytes
        self._heads: dict[bytes, _Known] = {}
        # What was received, and how much of it was read.
        self._data = b""
        self._at = 0
        self._phase = _Phase.IDLE
        self._stopping = False
        self.is_known = False
        self.heard = time.monotonic()
        self._due = self.heard + _UNKNOWN_SECONDS

    def serve(self) -> None:
        """Answer requests until the client leaves, is silent for too long, or the server stops."""
        # A client that has left needs no response, so socket errors are ignored.
        with contextlib.suppress(OSError), self._socket:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            try:
                while self._answer_next():
                    pass
            except _RefusedError as refusal:
                self._send(refusal.response, False, refusal.with_body)
                self._discard()

    def _answer_next(self) -> bool:
        """Answer one request; return whether another may follow."""
        raw = self._read_head()
        known = self._heads.get(raw) or self._admit(raw)
        head, (respond, _, lasts) = known
        if head.expects and self._at == len(self._data):
            self._socket.sendall(b"HTTP/1.1 100 Continue\r\n\r\n")
        if head.body_bytes is not None:
            body = self._read(head.body_bytes)
        else:
            body = self._read_chunks(lasts)
        self._phase = _Phase.ANSWERING
        response = respond(body, self._is_connected)
        del body
        if response.take_over is not None:
            self._hand_over(response, response.take_over)
            return False
        keep = head.keep_alive and self.is_known and not self._stopping
        self._send(response, keep, head.method != "HEAD")
        return keep

    def _admit(self, raw: bytes) -> _Known:
        """Read a new head, and let the application admit it."""
        try:
            head = RequestHead(raw)
        except HttpParserError as error:
            raise self._refusal(400, str(error)) from None
        admission = self._app.admit({**self._base_environ, **head.environ})
        if isinstance(admission, Response):
            raise _RefusedError(admission, with_body=head.method != "HEAD")
        self._check_size(head.body_bytes or 0, admission.lasts)
        if admission.is_known and not self.is_known:
            self.is_known = True
            self._socket.settimeout(_IDLE_SECONDS)
        known = _Known(head, admission)
        if admission.lasts and len(raw) <= _LONGEST_HEAD:
            if len(self._heads) == _MOST_HEADS:
                self._heads.clear()
            self._heads[raw] = known
        return known

    def _refusal(self, status: int, reason: str = "") -> _RefusedError:
        return _RefusedError(self._app.refuse(status, reason))

    def _check_size(self, size: int, is_trusted: bool) -> None:
        if size > (self._max_body_bytes if is_trusted else _UNTRUSTED_BODY_BYTES):
            raise self._refusal(413)

    # Receiving ------------------------------------------------------------------------------

    def _receive(self, most: int = _RECEIVE_BYTES) -> bytes:
        if not self.is_known:
            self._limit_time()
        data = self._socket.recv(most)
        if not data:
            raise ConnectionError("the client has left")
        return data

    def _limit_time(self) -> None:
        """Let the next wait for an unknown client end in time."""
        left = self._due - time.monotonic()
        if left <= 0:
            raise TimeoutError("a client that is not known has no more time")
        self._socket.settimeout(left)

    def _read_head(self) -> bytes:
        """Return the next head, up to and with the empty line."""
        while True:
            # Empty lines may precede a request.
            self._data = self._data[self._at :].lstrip(b"\r\n")
            self._at = 0
            if self._data:
                self._phase = _Phase.RECEIVING
                return self._read_until(b"\r\n\r\n", "its head")
            self._phase = _Phase.IDLE
            self._data = self._receive()
            self.heard = time.monotonic()

    def _read_until(self, mark: bytes, what: str) -> bytes:
        """Return what comes up to and with a mark."""
        begin = searched = self._at
        while (end := self._data.find(mark, searched)) < 0:
            if len(self._data) - begin > MOST_BYTES:
                break
            self._data, begin = self._data[begin:], 0
            searched = max(0, len(self._data) - len(mark) + 1)
            self._data += self._receive()
        self._at = end + len(mark)
        if end < 0 or self._at - begin > MOST_BYTES:
            raise self._refusal(400, f"{what} has more than {MOST_BYTES} bytes")
        return self._data[begin : self._at]

    def _read(self, size: int) -> bytes:
        """Return the next bytes."""
        begin, self._at = self._at, self._at + size
        data = self._data[begin : self._at]
        if len(data) == size:
            return data
        self._data, self._at = b"", 0
        parts, left = [data], size - len(data)
        while left:
            parts.append(self._receive(min(left, _RECEIVE_BYTES)))
            left -= len(parts[-1])
        return b"".join(parts)

    def _read_chunks(self, is_trusted: bool) -> bytes:
        """Return a body that comes in chunks."""
        body = bytearray()
        while size := self._read_chunk_size():
            self._check_size(len(body) + size, is_trusted)
            body += self._read(size)
            if self._read(2) != b"\r\n":
                raise self._refusal(400, "a chunk is longer than it says")
        for _ in range(_MOST_TRAILERS):
            if self._read_until(b"\r\n", "a trailer") == b"\r\n":
                return bytes(body)
        raise self._refusal(400, f"it has more than {_MOST_TRAILERS} trailers")

    def _read_chunk_size(self) -> int:
        match = _CHUNK_SIZE.fullmatch(self._read_until(b"\r\n", "the size of a chunk"))
        if match is None:
            raise self._refusal(400, "a chunk does not say its size")
        return int(match[1], 16)

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

    # Sending --------------------------------------------------------------------------------

    def _send(self, response: Response, keep: bool, with_body: bool = True) -> None:
        if not self.is_known:
            self._limit_time()
        head, body = _head(response, keep), response.body if with_body else b""
        # One packet where the copy is cheap: a second one would arrive later.
        if len(body) <= _COPIED_BYTES:
            self._socket.sendall(head + body)
        else:
            self._socket.sendall(head)
            self._socket.sendall(body)

    def _discard(self) -> None:
        """Let a client that is still sending see the response."""
        self._socket.shutdown(socket.SHUT_WR)
        ends = math.inf if self.is_known else self._due
        left = _DISCARD_BYTES
        self._socket.settimeout(_DISCARD_SECONDS)
        while left > 0 and time.monotonic() < ends:
            data = self._socket.recv(_RECEIVE_BYTES)
            if not data:
                break
            left -= len(data)

    def _hand_over(
        self, response: Response, take_over: Callable[[socket.socket, bytes], None]
    ) -> None:
        self._send(response, keep=True)
        self._phase = _Phase.TAKEN_OVER
        self._socket.settimeout(None)
        take_over(self._socket, self._data[self._at :])

    # For other threads ----------------------------------------------------------------------

    def stop(self, half_sent: bool) -> None:
        """Make ``serve()`` end once it has answered the requests that have arrived.

        Args:
            half_sent: whether to drop requests that have only partly arrived.
        """
        self._stopping = True
        if self._phase in (_Phase.IDLE, _Phase.TAKEN_OVER) or (
            half_sent and self._phase is _Phase.RECEIVING
        ):
            self.end()

    @property
    def rank(self) -> tuple[bool, bool, float] | None:
        """What to sort by to make room, first those that leave; None if it is at work."""
        if self._phase not in (_Phase.IDLE, _Phase.RECEIVING):
            return None
        return self.is_known, self._phase is _Phase.IDLE, self.heard

    def end(self) -> None:
        """Receive no more; a request that has arrived is still answered."""
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
    if not keep:
        head += "Connection: close\r\n"
    return f"{head}\r\n".encode("latin-1")


@lru_cache(maxsize=2)
def _date(second: int) -> str:
    return email.utils.formatdate(second, usegmt=True)
