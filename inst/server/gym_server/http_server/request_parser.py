"""Parse bytes into requests with httptools (llhttp, the parser of Node.js)."""

from __future__ import annotations

from collections.abc import Callable
from urllib.parse import unquote_to_bytes

from httptools import HttpParserError, HttpParserUpgrade, HttpRequestParser, parse_url

from gym_server.budget import Share
from gym_server.response import Response

_LARGEST_HEAD_BYTES = 2**16

# Browsers send about twenty, and proxies add a few. A line takes far more memory than its bytes.
_MOST_HEAD_LINES = 100

# Bodies up to this size are read without asking whether the request is admitted and whether memory
# is left. Larger bodies take memory in pieces of this size.
_SMALL_BODY_BYTES = 2**16

# How much of a refused body is read and discarded, so that its sender sees the response.
_DISCARD_BYTES = 2**30

# The headers that ask for another protocol.
_UPGRADE_HEADERS = (b"connection", b"upgrade")


class Request:
    """A request as it was read.

    Attributes:
        url: the URL as it was sent.
        headers: names in lower case, and values.
        head_bytes: the size of the URL and all header names and values.
        body: the part of the body that has arrived.
        body_bytes: the size of the body so far, including discarded bytes.
        held_bytes: the memory taken for the body.
        method: such as "GET"; empty until the head is complete.
        version: the HTTP version, such as "1.1".
        keep_alive: whether the client wants to keep the connection.
        was_checked: whether the application was asked to admit the request.
        refusal: a response that is sent instead of calling the application.
        rest: what follows it on the connection, if it asks for a WebSocket.
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
        self.rest = b""

    def same_head(self, other: Request) -> bool:
        """Return whether another request has the same head."""
        return (
            self.url == other.url
            and self.headers == other.headers
            and self.method == other.method
            and self.version == other.version
        )

    def add(self, data: bytes) -> None:
        """Add a piece of the body. Most bodies come in one piece, which is not copied."""
        if not self.body:
            self.body = data
            return
        if isinstance(self.body, bytes):
            self.body = bytearray(self.body)
        self.body += data

    def plain_head(self) -> bytes:
        """Return the head without the headers that ask for another protocol."""
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
        """Return the WSGI environ entries for the head."""
        path, query = self._target()
        environ = {
            "REQUEST_METHOD": self.method,
            "PATH_INFO": unquote_to_bytes(path).decode("latin-1"),
            "QUERY_STRING": query.decode("latin-1"),
            "SERVER_PROTOCOL": f"HTTP/{self.version}",
        }
        for name, value in self.headers:
            # In CGI names, an underscore cannot be told from a hyphen.
            if b"_" not in name:
                key = "HTTP_" + name.decode("latin-1").upper().replace("-", "_")
                text = value.decode("latin-1")
                environ[key] = f"{environ[key]},{text}" if key in environ else text
        environ["CONTENT_TYPE"] = environ.pop("HTTP_CONTENT_TYPE", "")
        # The body is passed on complete and decoded, so these two no longer apply.
        environ.pop("HTTP_CONTENT_LENGTH", None)
        environ.pop("HTTP_TRANSFER_ENCODING", None)
        return environ

    def _target(self) -> tuple[bytes, bytes]:
        if self.url.startswith(b"/"):
            path, _, query = self.url.partition(b"?")
            return path, query
        # An absolute URL, as clients send it to a proxy.
        url = parse_url(self.url)
        return url.path or b"/", url.query or b""


class RequestParser:
    """Turns bytes into requests; httptools calls the ``on_`` methods."""

    def __init__(
        self,
        max_body_bytes: int,
        send: Callable[[bytes], None],
        refusal: Callable[[Request], Response | None],
        bodies: Share,
        refuse: Callable[[int, str], Response],
    ) -> None:
        """Start with no data.

        Args:
            max_body_bytes: the size of the largest body.
            send: sends bytes to the client before a request is complete.
            refusal: returns a response that refuses a request before its large body is read, or
                None to read it.
            bodies: the memory that large bodies hold.
            refuse: see ``Application.refuse()``.
        """
        self._max_body_bytes = max_body_bytes
        self._unchecked_bytes = min(max_body_bytes, _SMALL_BODY_BYTES)
        self._send = send
        self._refusal = refusal
        self._bodies = bodies
        self._refuse = refuse
        self._parser = HttpRequestParser(self)
        self._request = Request()
        self._complete: list[Request] = []
        # Bytes since the parser last called an ``on_`` method.
        self._unreported_bytes = 0
        # The reason for rejecting a request that httptools would accept.
        self._fault = ""
        # Whether part of a request has arrived.
        self.began = False

    def release(self, request: Request) -> None:
        """Release the memory taken for a request's body."""
        self._bodies.give_back(request.held_bytes)
        request.held_bytes = 0

    def close(self) -> None:
        """Release all memory, including that of a partly received request.

        The parser, the connection and this object refer to each other. Without breaking this
        cycle, they and the bodies they hold would stay until Python's garbage collection.
        """
        self._bodies.give_all_back()
        self._parser = HttpRequestParser(None)
        self._send = lambda data: None
        self._refusal = lambda request: None
        self._request = Request()
        self._complete = []

    def feed(self, data: bytes) -> list[Request]:
        """Parse received bytes; return the requests they complete."""
        self._complete = []
        self._unreported_bytes += len(data)
        try:
            while data:
                try:
                    self._parser.feed_data(data)
                    data = b""
                except HttpParserUpgrade as upgrade:
                    data = self._without_upgrade(data[upgrade.args[0] :])
            if self._unreported_bytes > _LARGEST_HEAD_BYTES:
                self._refuse_head()
        except HttpParserError as error:
            self._end_with(self._refuse(400, self._fault or str(error)))
        return self._complete

    def _without_upgrade(self, rest: bytes) -> bytes:
        """Return the bytes to parse again after a client asked for another protocol.

        httptools treats everything that follows as that protocol, including the request's body. So
        the head is parsed again without the headers that ask for it.
        """
        request = self._complete.pop()
        if request.method == "GET" and (b"upgrade", b"websocket") in request.headers:
            # Whatever the answer is, no other request follows.
            request.rest = rest
            request.keep_alive = False
            self._complete.append(request)
            self._parser = HttpRequestParser(self)
            return b""
        if request.method == "CONNECT":
            self._request = request
            self._end_with(self._refuse(400, "this is no proxy"))
            return b""
        self._parser = HttpRequestParser(self)
        return request.plain_head() + rest

    def _end_with(self, refusal: Response) -> None:
        """Refuse the current request; the connection closes after the response."""
        self._request.refusal = refusal
        self._request.keep_alive = False
        self._finish()

    def _finish(self) -> None:
        self._complete.append(self._request)
        self._request = Request()
        self.began = False

    def on_message_begin(self) -> None:
        """Note that a request has started."""
        self.began = True

    def on_url(self, url: bytes) -> None:
        """Add a piece of the URL."""
        request = self._request
        request.url += url
        request.head_bytes += len(url)
        if request.head_bytes > _LARGEST_HEAD_BYTES:
            self._refuse_head()

    def on_header(self, name: bytes, value: bytes) -> None:
        """Add a header; ignore trailers, which follow a chunked body."""
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
        """Decide whether to read the body."""
        self._unreported_bytes = 0
        request = self._request
        request.method = self._parser.get_method().decode("ascii")
        request.version = self._parser.get_http_version()
        if self._parser.should_upgrade():
            # _parse() feeds the head again.
            return
        headers = dict(request.headers)
        if b"transfer-encoding" in headers and not _is_plainly_chunked(request):
            # A proxy in front of this server might disagree about where the body ends.
            self._fault = "it does not say in one way where it ends"
            raise HttpParserError
        size = int(headers.get(b"content-length", 0))
        if size > self._unchecked_bytes:
            self._check_size(size)
        if headers.get(b"expect", b"").lower() == b"100-continue":
            if request.refusal is not None:
                self._end_with(request.refusal)
            else:
                self._send(b"HTTP/1.1 100 Continue\r\n\r\n")

    def on_body(self, data: bytes) -> None:
        """Add a piece of the body."""
        self._unreported_bytes = 0
        request = self._request
        request.body_bytes += len(data)
        if request.body_bytes > self._unchecked_bytes:
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
        elif not self._request.was_checked:
            self._request.was_checked = True
            if refusal := self._refusal(self._request):
                self._discard_body(refusal)

    def _hold_more(self, request: Request) -> None:
        if self._bodies.take(_SMALL_BODY_BYTES):
            request.held_bytes += _SMALL_BODY_BYTES
        else:
            self._discard_body(self._refuse(503, ""))

    def _discard_body(self, refusal: Response) -> None:
        """Discard the body as it arrives; its sender gets the response when it is done."""
        self._request.refusal = refusal
        self._request.body = b""
        self.release(self._request)

    def on_message_complete(self) -> None:
        """Add the request to those that are complete."""
        self._unreported_bytes = 0
        # HTTP/1.0 clients expect a header for keep-alive, which this server does not send.
        self._request.keep_alive = (
            self._parser.should_keep_alive() and self._request.version == "1.1"
        )
        self._finish()


def _is_plainly_chunked(request: Request) -> bool:
    framing = [h for h in request.headers if h[0] in (b"transfer-encoding", b"content-length")]
    chunked = len(framing) == 1 and framing[0][1].strip(b" \t").lower() == b"chunked"
    return chunked and request.version == "1.1"
