"""One client's connection: its requests come in, their answers go out, in a thread of its own.

httptools reads the requests (it is llhttp, the parser of Node.js); WSGI calls the application.
"""

from __future__ import annotations

import contextlib
import email.utils
import io
import socket
import sys
import time
from collections.abc import Callable
from functools import lru_cache
from http import HTTPStatus
from urllib.parse import unquote_to_bytes

from httptools import HttpParserError, HttpParserUpgrade, HttpRequestParser, parse_url

from gym_server import wire
from gym_server.errors import GymServerError, answer_to

# Seconds that a connection may be idle, and that the next bytes of a begun request may take.
_IDLE_SECONDS = 3600.0
_REST_SECONDS = 60.0

# And how many a second must come of it, on the whole.
_SLOWEST_BYTES = 1000

# The header of answers that are worth nothing later.
_NOT_KEPT = ("Cache-Control", "no-store")

_RECEIVE_BYTES = 2**16
_LARGEST_HEAD_BYTES = 2**16

# A body that is read before anybody asks whose it is.
_UNASKED_BYTES = 2**16

# Of a request that is refused for its size, so that its sender gets to see the answer.
_DISCARD_BYTES = 2**30


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
        self._reader = _Reader(max_body_bytes, client.sendall, self._why_not)
        self._admit = admit
        self._last: _Request | None = None
        self._last_environ: dict = {}
        self._stopping = False
        self._answering = False
        # When the rest of a begun request must be there.
        self._due = 0.0
        # Whether what is sent is of this moment only.
        self._passing = False

    def serve(self) -> None:
        """Answer until the client leaves, is silent for too long, or the server stops."""
        # Whoever is not there any more needs no answer.
        with contextlib.suppress(OSError), self._socket:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._socket.settimeout(_IDLE_SECONDS)
            in_part = False
            while data := self._socket.recv(_RECEIVE_BYTES):
                self._answering = True
                requests = self._reader.feed(data)
                if not self._answer_all(requests):
                    break
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

    def _why_not(self, request: _Request) -> GymServerError | None:
        try:
            self._admit({**self._base_environ, **request.environ()})
        except GymServerError as refusal:
            return refusal
        except HttpParserError as error:
            return _malformed(str(error))
        return None

    def _answer_all(self, requests: list[_Request]) -> bool:
        return all(map(self._answer, requests))

    def _answer(self, request: _Request) -> bool:
        """Answer one request; return whether another may follow."""
        status, headers, body = self._respond(request)
        keep = request.keep_alive and not self._stopping
        head = [f"HTTP/1.1 {status}"]
        head += [f"{name}: {value}" for name, value in headers]
        head.append(f"Date: {_date(int(time.time()))}")
        if not keep:
            head.append("Connection: close")
        head.append("\r\n")
        self._passing = _NOT_KEPT in headers
        # In one piece: a body that follows its header is held back until that is acknowledged.
        self._socket.sendall("\r\n".join(head).encode("latin-1") + body)
        self._passing = False
        return keep

    def _respond(self, request: _Request) -> tuple[str, list[tuple[str, str]], bytes]:
        if request.refusal is not None:
            return _refuse(request.refusal)
        try:
            environ = self._environ(request)
        except HttpParserError as error:
            return _refuse(_malformed(str(error)))
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

    def _environ(self, request: _Request) -> dict:
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


@lru_cache(maxsize=2)
def _date(second: int) -> str:
    return email.utils.formatdate(second, usegmt=True)


class _Request:
    """A request as it was read."""

    def __init__(self) -> None:
        self.url = b""
        self.headers: list[tuple[bytes, bytes]] = []
        self.body: list[bytes] = []
        self.body_bytes = 0
        self.method = ""
        self.version = ""
        self.keep_alive = False
        # Whether it was asked who sends it.
        self.asked = False
        # Why it is not handed to the application.
        self.refusal: GymServerError | None = None

    def same_head(self, other: _Request) -> bool:
        """Tell whether another request came with the same words before its body."""
        return (
            self.url == other.url
            and self.headers == other.headers
            and self.method == other.method
            and self.version == other.version
        )

    def plain_head(self) -> bytes:
        """Return its head without the wish for another protocol."""
        lines = [b"%s %s HTTP/1.1" % (self.method.encode("ascii"), self.url)]
        lines += [b": ".join(h) for h in self.headers if h[0] not in (b"connection", b"upgrade")]
        return b"\r\n".join((*lines, b"", b""))

    def environ(self) -> dict:
        """Return what its head says to WSGI."""
        path, query = self._target()
        environ = {
            "REQUEST_METHOD": self.method,
            "PATH_INFO": unquote_to_bytes(path).decode("latin-1"),
            "QUERY_STRING": query.decode("latin-1"),
            "SERVER_PROTOCOL": f"HTTP/{self.version}",
        }
        for name, value in self.headers:
            # A name with an underscore would pass for another with a hyphen.
            if b"_" not in name:
                key = "HTTP_" + name.decode("latin-1").upper().replace("-", "_")
                text = value.decode("latin-1")
                environ[key] = f"{environ[key]},{text}" if key in environ else text
        environ["CONTENT_TYPE"] = environ.pop("HTTP_CONTENT_TYPE", "")
        # The body has neither any more: it is handed on as a whole.
        environ.pop("HTTP_CONTENT_LENGTH", None)
        environ.pop("HTTP_TRANSFER_ENCODING", None)
        return environ

    def _target(self) -> tuple[bytes, bytes]:
        if self.url.startswith(b"/"):
            path, _, query = self.url.partition(b"?")
            return path, query
        # With its host, as it is sent to proxies.
        url = parse_url(self.url)
        return url.path or b"/", url.query or b""


class _Reader:
    """Makes requests of bytes; the parser calls the methods that begin with ``on_``."""

    def __init__(
        self,
        max_body_bytes: int,
        send: Callable[[bytes], None],
        why_not: Callable[[_Request], GymServerError | None],
    ) -> None:
        self._max_body_bytes = max_body_bytes
        self._send = send
        self._why_not = why_not
        self._parser = HttpRequestParser(self)
        self._request = _Request()
        self._complete: list[_Request] = []
        # Bytes since the parser last had something to say.
        self._silent_bytes = 0
        # What we have against a request that the parser would take.
        self._fault: GymServerError | None = None
        # Whether a request has come in part.
        self.began = False

    def feed(self, data: bytes) -> list[_Request]:
        """Take what has arrived; return the requests that are complete with it."""
        self._complete = []
        self._silent_bytes += len(data)
        try:
            while data:
                data = self._parse(data)
        except HttpParserError as error:
            self._give_up(self._fault or _malformed(str(error)))
        if self._silent_bytes > _LARGEST_HEAD_BYTES:
            self._give_up(_malformed(f"its head has more than {_LARGEST_HEAD_BYTES} bytes"))
        return self._complete

    def _parse(self, data: bytes) -> bytes:
        """Parse; return what is left."""
        try:
            self._parser.feed_data(data)
        except HttpParserUpgrade as upgrade:
            # To a protocol that we do not speak. The parser takes what follows for that, also the
            # request's body, so it gets the head once more without the wish.
            wished = self._complete.pop()
            if wished.method == "CONNECT":
                self._request = wished
                self._give_up(_malformed("this is no proxy"))
                return b""
            self._parser = HttpRequestParser(self)
            return wished.plain_head() + data[upgrade.args[0] :]
        return b""

    def _give_up(self, refusal: GymServerError) -> None:
        """Answer what has come so far, and then no more."""
        self._request.refusal = refusal
        self._request.keep_alive = False
        self._finish()

    def _finish(self) -> None:
        self._complete.append(self._request)
        self._request = _Request()
        self.began = False

    def on_message_begin(self) -> None:
        self.began = True

    def on_url(self, url: bytes) -> None:
        self._request.url += url

    def on_header(self, name: bytes, value: bytes) -> None:
        # Those that come after a body in chunks are nobody's business.
        if not self._request.method:
            self._request.headers.append((name.lower(), value))

    def on_headers_complete(self) -> None:
        self._silent_bytes = 0
        request = self._request
        request.method = self._parser.get_method().decode("ascii")
        request.version = self._parser.get_http_version()
        headers = dict(request.headers)
        if b"transfer-encoding" in headers and not _is_plainly_chunked(request):
            # A proxy may have seen its end elsewhere.
            self._fault = _malformed("it does not say in one way where it ends")
            raise HttpParserError
        self._check_size(int(headers.get(b"content-length", 0)))
        if headers.get(b"expect", b"").lower() == b"100-continue":
            if request.refusal is not None:
                self._give_up(request.refusal)
            else:
                self._send(b"HTTP/1.1 100 Continue\r\n\r\n")

    def on_body(self, data: bytes) -> None:
        self._silent_bytes = 0
        request = self._request
        request.body_bytes += len(data)
        self._check_size(request.body_bytes)
        if request.refusal is None:
            request.body.append(data)
        elif request.body_bytes > _DISCARD_BYTES:
            self._give_up(request.refusal)

    def _check_size(self, size: int) -> None:
        if size > self._max_body_bytes:
            self._request.body.clear()
            self._request.refusal = GymServerError(
                "body_too_large", "The request's body is larger than this server takes"
            )
        elif size > _UNASKED_BYTES and not self._request.asked:
            self._request.asked = True
            self._request.refusal = self._why_not(self._request)
            if self._request.refusal is not None:
                self._request.body.clear()

    def on_message_complete(self) -> None:
        self._silent_bytes = 0
        # HTTP/1.0 would need to be told.
        self._request.keep_alive = (
            self._parser.should_keep_alive() and self._request.version == "1.1"
        )
        self._finish()


def _is_plainly_chunked(request: _Request) -> bool:
    framing = [h for h in request.headers if h[0] in (b"transfer-encoding", b"content-length")]
    chunked = len(framing) == 1 and framing[0][1].strip(b" \t").lower() == b"chunked"
    return chunked and request.version == "1.1"


def _malformed(reason: str) -> GymServerError:
    return GymServerError("malformed_json", f"The request cannot be read: {reason}")
