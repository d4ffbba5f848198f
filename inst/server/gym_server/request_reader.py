"""Requests out of bytes.

httptools reads them (it is llhttp, the parser of Node.js).
"""

from __future__ import annotations

from collections.abc import Callable
from urllib.parse import unquote_to_bytes

from httptools import HttpParserError, HttpParserUpgrade, HttpRequestParser, parse_url

from gym_server.errors import GymServerError, body_too_large

_LARGEST_HEAD_BYTES = 2**16

# A body that is read before anybody asks whose it is.
_UNASKED_BYTES = 2**16

# Of a request that is refused for its size, so that its sender gets to see the answer.
_DISCARD_BYTES = 2**30


class Request:
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

    def same_head(self, other: Request) -> bool:
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


class Reader:
    """Makes requests of bytes; the parser calls the methods that begin with ``on_``."""

    def __init__(
        self,
        max_body_bytes: int,
        send: Callable[[bytes], None],
        why_not: Callable[[Request], GymServerError | None],
    ) -> None:
        self._max_body_bytes = max_body_bytes
        self._send = send
        self._why_not = why_not
        self._parser = HttpRequestParser(self)
        self._request = Request()
        self._complete: list[Request] = []
        # Bytes since the parser last had something to say.
        self._silent_bytes = 0
        # What we have against a request that the parser would take.
        self._fault: GymServerError | None = None
        # Whether a request has come in part.
        self.began = False

    def feed(self, data: bytes) -> list[Request]:
        """Take what has arrived; return the requests that are complete with it."""
        self._complete = []
        self._silent_bytes += len(data)
        try:
            while data:
                data = self._parse(data)
        except HttpParserError as error:
            self._give_up(self._fault or malformed(str(error)))
        if self._silent_bytes > _LARGEST_HEAD_BYTES:
            self._give_up(malformed(f"its head has more than {_LARGEST_HEAD_BYTES} bytes"))
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
                self._give_up(malformed("this is no proxy"))
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
        self._request = Request()
        self.began = False

    def on_message_begin(self) -> None:
        """Note that a request has begun."""
        self.began = True

    def on_url(self, url: bytes) -> None:
        """Take a piece of the URL."""
        self._request.url += url

    def on_header(self, name: bytes, value: bytes) -> None:
        """Take a header."""
        # Those that come after a body in chunks are nobody's business.
        if not self._request.method:
            self._request.headers.append((name.lower(), value))

    def on_headers_complete(self) -> None:
        """Look whether the body is wanted."""
        self._silent_bytes = 0
        request = self._request
        request.method = self._parser.get_method().decode("ascii")
        request.version = self._parser.get_http_version()
        headers = dict(request.headers)
        if b"transfer-encoding" in headers and not _is_plainly_chunked(request):
            # A proxy may have seen its end elsewhere.
            self._fault = malformed("it does not say in one way where it ends")
            raise HttpParserError
        self._check_size(int(headers.get(b"content-length", 0)))
        if headers.get(b"expect", b"").lower() == b"100-continue":
            if request.refusal is not None:
                self._give_up(request.refusal)
            else:
                self._send(b"HTTP/1.1 100 Continue\r\n\r\n")

    def on_body(self, data: bytes) -> None:
        """Take a piece of the body."""
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
            self._request.refusal = body_too_large()
        elif size > _UNASKED_BYTES and not self._request.asked:
            self._request.asked = True
            self._request.refusal = self._why_not(self._request)
            if self._request.refusal is not None:
                self._request.body.clear()

    def on_message_complete(self) -> None:
        """Put the request with those that are complete."""
        self._silent_bytes = 0
        # HTTP/1.0 would need to be told.
        self._request.keep_alive = (
            self._parser.should_keep_alive() and self._request.version == "1.1"
        )
        self._finish()


def _is_plainly_chunked(request: Request) -> bool:
    framing = [h for h in request.headers if h[0] in (b"transfer-encoding", b"content-length")]
    chunked = len(framing) == 1 and framing[0][1].strip(b" \t").lower() == b"chunked"
    return chunked and request.version == "1.1"


def malformed(reason: str) -> GymServerError:
    """Refuse what cannot be read as a request."""
    return GymServerError("malformed_json", f"The request cannot be read: {reason}")
