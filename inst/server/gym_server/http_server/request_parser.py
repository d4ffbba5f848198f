"""Requests out of bytes.

httptools reads them (it is llhttp, the parser of Node.js).
"""

from __future__ import annotations

from collections.abc import Callable
from urllib.parse import unquote_to_bytes

from httptools import HttpParserError, HttpParserUpgrade, HttpRequestParser, parse_url

from gym_server.budget import Share
from gym_server.errors import GymServerError, body_too_large, busy_receiving

_LARGEST_HEAD_BYTES = 2**16

# A body that is read before anybody asks whose it is, or whether there is room for it; room is
# asked for in pieces of this size.
_UNASKED_BYTES = 2**16

# Of a request that is refused for its size, so that its sender gets to see the answer.
_DISCARD_BYTES = 2**30


_WISH = (b"connection", b"upgrade")


class Request:
    """A request as it was read."""

    def __init__(self) -> None:
        self.url = b""
        self.headers: list[tuple[bytes, bytes]] = []
        self.body: bytes | bytearray = b""
        self.body_bytes = 0
        # How much room it was given beyond what nobody asks about.
        self.held_bytes = 0
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

    def add(self, data: bytes) -> None:
        """Take a piece of the body; most come in one, which is not copied."""
        if not self.body:
            self.body = data
            return
        if isinstance(self.body, bytes):
            self.body = bytearray(self.body)
        self.body += data

    def plain_head(self) -> bytes:
        """Return its head without the wish for another protocol."""
        lines = [b"%s %s HTTP/%s" % (self.method.encode(), self.url, self.version.encode())]
        lines += [b": ".join(header) for header in self.headers if header[0] not in _WISH]
        lines += [b"connection: %s" % wish for wish in self._other_wishes()]
        return b"\r\n".join((*lines, b"", b""))

    def _other_wishes(self) -> list[bytes]:
        said = b",".join(value for name, value in self.headers if name == b"connection")
        return [wish for wish in said.split(b",") if wish.strip().lower() not in (b"", b"upgrade")]

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
        bodies: Share,
    ) -> None:
        """Begin to read.

        Args:
            max_body_bytes: the size of the largest body.
            send: sends what has to be said before a request is complete.
            why_not: tells of a request whose large body is still to come why it is refused.
            bodies: what large bodies may hold.
        """
        self._max_body_bytes = max_body_bytes
        self._send = send
        self._why_not = why_not
        self._bodies = bodies
        self._parser = HttpRequestParser(self)
        self._request = Request()
        self._complete: list[Request] = []
        # Bytes since the parser last had something to say.
        self._silent_bytes = 0
        # What we have against a request that the parser would take.
        self._fault: GymServerError | None = None
        # Whether a request has come in part.
        self.began = False

    def release(self, request: Request) -> None:
        """Let go of the room that a request's body had."""
        self._bodies.give_back(request.held_bytes)
        request.held_bytes = 0

    def close(self) -> None:
        """Let go of everything, also of a request that has come in part.

        The parser and the connection know this reader, and it knows them. Without this all would
        keep each other, and what they hold, until a collection of garbage comes across them.
        """
        self._bodies.give_all_back()
        self._parser = HttpRequestParser(None)
        self._send = self._why_not = lambda _: None
        self._request = Request()
        self._complete = []

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
        if self._parser.should_upgrade():
            # It comes once more, without that wish.
            return
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
        while request.refusal is None and request.body_bytes > request.held_bytes + _UNASKED_BYTES:
            self._hold_more(request)
        if request.refusal is None:
            request.add(data)
        elif request.body_bytes > _DISCARD_BYTES:
            self._give_up(request.refusal)

    def _check_size(self, size: int) -> None:
        if size > self._max_body_bytes:
            self._refuse(body_too_large())
        elif size > _UNASKED_BYTES and not self._request.asked:
            self._request.asked = True
            if refusal := self._why_not(self._request):
                self._refuse(refusal)

    def _hold_more(self, request: Request) -> None:
        if self._bodies.take(_UNASKED_BYTES):
            request.held_bytes += _UNASKED_BYTES
        else:
            self._refuse(busy_receiving())

    def _refuse(self, refusal: GymServerError) -> None:
        """Throw away what comes of the body; its sender hears why at its end."""
        self._request.refusal = refusal
        self._request.body = b""
        self.release(self._request)

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
