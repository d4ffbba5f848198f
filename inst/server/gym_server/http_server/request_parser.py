"""Bytes become requests, by httptools (which is llhttp, the parser of Node.js)."""

from __future__ import annotations

from collections.abc import Callable
from urllib.parse import unquote_to_bytes

from httptools import HttpParserError, HttpParserUpgrade, HttpRequestParser, parse_url

from gym_server.budget import Share
from gym_server.response import Response

_LARGEST_HEAD_BYTES = 2**16

# Browsers send some twenty, and a proxy adds a few. Each line takes far more memory than its bytes.
_MOST_HEAD_LINES = 100

# A body of this size is read without asking whether the request is admitted, and whether there is
# memory left for it; of a larger one memory is taken in pieces of this size.
_SMALL_BODY_BYTES = 2**16

# So much of a refused body is read and thrown away, so that its sender gets to see the answer.
_DISCARD_BYTES = 2**30

# The headers that ask for another protocol.
_UPGRADE_HEADERS = (b"connection", b"upgrade")


class Request:
    """A request as it was read.

    Attributes:
        url: as it was sent.
        headers: names in lower case, and values.
        head_bytes: the size of the URL, and of these names and values.
        body: what has come of it.
        body_bytes: the size of all that has come of it, also of what was thrown away.
        held_bytes: the memory that was taken for it.
        method: such as "GET"; empty until the head is complete.
        version: of HTTP, such as "1.1".
        keep_alive: whether the client wants the connection to stay.
        was_checked: whether it was asked whether the request is admitted.
        refusal: the response, if the request is not handed to the application.
    """

    def __init__(self) -> None:
        self.url = b""
        self.headers: list[tuple[bytes, bytes]] = []
        self.head_bytes = 0
        self.body: bytes | bytearray = b""
        self.body_bytes = 0
        self.held_bytes = 0
        self.method = ""
        self.version = ""
        self.keep_alive = False
        self.was_checked = False
        self.refusal: Response | None = None

    def same_head(self, other: Request) -> bool:
        """Tell whether another request has the same head."""
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
        """Return its head without the headers that ask for another protocol."""
        lines = [b"%s %s HTTP/%s" % (self.method.encode(), self.url, self.version.encode())]
        others = [header for header in self.headers if header[0] not in _UPGRADE_HEADERS]
        lines += [b": ".join(header) for header in others]
        lines += [b"connection: %s" % option for option in self._other_connection_options()]
        return b"\r\n".join((*lines, b"", b""))

    def _other_connection_options(self) -> list[bytes]:
        options = b",".join(value for name, value in self.headers if name == b"connection")
        return [
            option
            for option in options.split(b",")
            if option.strip().lower() not in (b"", b"upgrade")
        ]

    def environ(self) -> dict:
        """Return what WSGI's environment holds of its head."""
        path, query = self._target()
        environ = {
            "REQUEST_METHOD": self.method,
            "PATH_INFO": unquote_to_bytes(path).decode("latin-1"),
            "QUERY_STRING": query.decode("latin-1"),
            "SERVER_PROTOCOL": f"HTTP/{self.version}",
        }
        for name, value in self.headers:
            # A name with an underscore could not be told from another with a hyphen.
            if b"_" not in name:
                key = "HTTP_" + name.decode("latin-1").upper().replace("-", "_")
                text = value.decode("latin-1")
                environ[key] = f"{environ[key]},{text}" if key in environ else text
        environ["CONTENT_TYPE"] = environ.pop("HTTP_CONTENT_TYPE", "")
        # The body is handed on as a whole, so these two do not hold for it any more.
        environ.pop("HTTP_CONTENT_LENGTH", None)
        environ.pop("HTTP_TRANSFER_ENCODING", None)
        return environ

    def _target(self) -> tuple[bytes, bytes]:
        if self.url.startswith(b"/"):
            path, _, query = self.url.partition(b"?")
            return path, query
        # An absolute URL, as clients send it to proxies.
        url = parse_url(self.url)
        return url.path or b"/", url.query or b""


class RequestParser:
    """Makes requests of bytes; httptools calls the methods that begin with ``on_``."""

    def __init__(
        self,
        max_body_bytes: int,
        send: Callable[[bytes], None],
        refusal: Callable[[Request], Response | None],
        bodies: Share,
        refuse: Callable[[int, str], Response],
    ) -> None:
        """Begin to read.

        Args:
            max_body_bytes: the size of the largest body.
            send: sends what has to be sent before a request is complete.
            refusal: returns the response that refuses a request whose large body is still to come,
                or None to let it pass.
            bodies: the memory that large bodies hold.
            refuse: see ``Application.refuse()``.
        """
        self._max_body_bytes = max_body_bytes
        self._send = send
        self._refusal = refusal
        self._bodies = bodies
        self._refuse = refuse
        self._parser = HttpRequestParser(self)
        self._request = Request()
        self._complete: list[Request] = []
        # Bytes since the parser last reported something.
        self._unreported_bytes = 0
        # What is wrong with a request that httptools would take.
        self._fault = ""
        # Whether a request has come in part.
        self.began = False

    def release(self, request: Request) -> None:
        """Give back the memory that was taken for a request's body."""
        self._bodies.give_back(request.held_bytes)
        request.held_bytes = 0

    def close(self) -> None:
        """Give back all memory, also that of a request that has come in part.

        httptools' parser and the connection refer to this object, and it refers to them. Without
        this cut all of them, and the bodies that they hold, would stay until Python collects
        garbage.
        """
        self._bodies.give_all_back()
        self._parser = HttpRequestParser(None)
        self._send = lambda data: None
        self._refusal = lambda request: None
        self._request = Request()
        self._complete = []

    def feed(self, data: bytes) -> list[Request]:
        """Take what has arrived; return the requests that are complete with it."""
        self._complete = []
        self._unreported_bytes += len(data)
        try:
            while data:
                data = self._parse(data)
            if self._unreported_bytes > _LARGEST_HEAD_BYTES:
                self._refuse_head()
        except HttpParserError as error:
            self._end_with(self._refuse(400, self._fault or str(error)))
        return self._complete

    def _parse(self, data: bytes) -> bytes:
        """Parse; return what is left."""
        try:
            self._parser.feed_data(data)
        except HttpParserUpgrade as upgrade:
            # The client asks for a protocol that this server does not speak. httptools takes all
            # that follows for that protocol, the request's body too. So a new parser gets the head
            # once more without the headers that ask for it.
            request = self._complete.pop()
            if request.method == "CONNECT":
                self._request = request
                self._end_with(self._refuse(400, "this is no proxy"))
                return b""
            self._parser = HttpRequestParser(self)
            return request.plain_head() + data[upgrade.args[0] :]
        return b""

    def _end_with(self, refusal: Response) -> None:
        """Answer what has come so far, after which the connection closes."""
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
        request = self._request
        request.url += url
        request.head_bytes += len(url)
        if request.head_bytes > _LARGEST_HEAD_BYTES:
            self._refuse_head()

    def on_header(self, name: bytes, value: bytes) -> None:
        """Take a header."""
        # Those that come after a body in chunks are ignored.
        request = self._request
        if not request.method:
            request.headers.append((name.lower(), value))
            request.head_bytes += len(name) + len(value)
            is_long = len(request.headers) > _MOST_HEAD_LINES
            if is_long or request.head_bytes > _LARGEST_HEAD_BYTES:
                self._refuse_head()

    def _refuse_head(self) -> None:
        if len(self._request.headers) > _MOST_HEAD_LINES:
            self._fault = f"its head has more than {_MOST_HEAD_LINES} lines"
        else:
            self._fault = f"its head has more than {_LARGEST_HEAD_BYTES} bytes"
        raise HttpParserError

    def on_headers_complete(self) -> None:
        """Decide whether the body is wanted."""
        self._unreported_bytes = 0
        request = self._request
        request.method = self._parser.get_method().decode("ascii")
        request.version = self._parser.get_http_version()
        if self._parser.should_upgrade():
            # The head comes once more, see _parse().
            return
        headers = dict(request.headers)
        if b"transfer-encoding" in headers and not _is_plainly_chunked(request):
            # A proxy before this server might see its end elsewhere.
            self._fault = "it does not say in one way where it ends"
            raise HttpParserError
        self._check_size(int(headers.get(b"content-length", 0)))
        if headers.get(b"expect", b"").lower() == b"100-continue":
            if request.refusal is not None:
                self._end_with(request.refusal)
            else:
                self._send(b"HTTP/1.1 100 Continue\r\n\r\n")

    def on_body(self, data: bytes) -> None:
        """Take a piece of the body."""
        self._unreported_bytes = 0
        request = self._request
        request.body_bytes += len(data)
        self._check_size(request.body_bytes)
        while (
            request.refusal is None and request.body_bytes > request.held_bytes + _SMALL_BODY_BYTES
        ):
            self._hold_more(request)
        if request.refusal is None:
            request.add(data)
        elif request.body_bytes > _DISCARD_BYTES:
            self._end_with(request.refusal)

    def _check_size(self, size: int) -> None:
        if size > self._max_body_bytes:
            self._discard_body(self._refuse(413, ""))
        elif size > _SMALL_BODY_BYTES and not self._request.was_checked:
            self._request.was_checked = True
            if refusal := self._refusal(self._request):
                self._discard_body(refusal)

    def _hold_more(self, request: Request) -> None:
        if self._bodies.take(_SMALL_BODY_BYTES):
            request.held_bytes += _SMALL_BODY_BYTES
        else:
            self._discard_body(self._refuse(503, ""))

    def _discard_body(self, refusal: Response) -> None:
        """Throw away what comes of the body; its sender gets the answer at its end."""
        self._request.refusal = refusal
        self._request.body = b""
        self.release(self._request)

    def on_message_complete(self) -> None:
        """Put the request with those that are complete."""
        self._unreported_bytes = 0
        # A client of HTTP/1.0 would expect a header that says so.
        self._request.keep_alive = (
            self._parser.should_keep_alive() and self._request.version == "1.1"
        )
        self._finish()


def _is_plainly_chunked(request: Request) -> bool:
    framing = [h for h in request.headers if h[0] in (b"transfer-encoding", b"content-length")]
    chunked = len(framing) == 1 and framing[0][1].strip(b" \t").lower() == b"chunked"
    return chunked and request.version == "1.1"
