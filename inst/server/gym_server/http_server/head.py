"""The head of a request, as httptools (llhttp, the parser of Node.js) reads it."""

from __future__ import annotations

import contextlib
from urllib.parse import unquote_to_bytes

from httptools import HttpParserError, HttpParserUpgrade, HttpRequestParser, parse_url

MOST_BYTES = 2**16

# Browsers send about twenty, and proxies add a few. A line takes far more memory than its bytes.
_MOST_LINES = 100


class RequestHead:
    """A request's method, target and headers, and what they say about its body.

    Attributes:
        environ: these as WSGI's entries.
        method: such as "GET".
        body_bytes: the size of the body; None if it comes in chunks.
        keep_alive: whether the client wants to keep the connection.
        expects: whether the client waits to be told to send the body.
    """

    def __init__(self, raw: bytes) -> None:
        """Read a head.

        Args:
            raw: its bytes, up to and with the empty line.

        Raises:
            HttpParserError: it is malformed.
        """
        if raw.count(b"\r\n") > _MOST_LINES + 2:
            raise HttpParserError(f"its head has more than {_MOST_LINES} lines")
        # Old versions of httptools would take that for the end of a line, and twice for the head's.
        if raw.count(b"\n") != raw.count(b"\r\n"):
            raise HttpParserError("a line ends without a carriage return")
        self.method = ""
        self._url = b""
        self._headers: list[tuple[bytes, bytes]] = []
        self._parser: HttpRequestParser | None = HttpRequestParser(self)
        # A request that asks for another protocol is a complete one, too.
        with contextlib.suppress(HttpParserUpgrade):
            self._parser.feed_data(raw)
        # It refers to this object.
        self._parser = None
        if self.method in ("", "CONNECT"):
            raise HttpParserError("this is no proxy" if self.method else "it has no head")
        self.environ = self._environ()

    def on_url(self, url: bytes) -> None:
        """Add a piece of the URL; called by httptools, as the next two."""
        self._url += url

    def on_header(self, name: bytes, value: bytes) -> None:
        """Add a header."""
        self._headers.append((name.lower(), value))

    def on_headers_complete(self) -> None:
        """Read what the head says about the body."""
        assert self._parser is not None
        self.method = self._parser.get_method().decode("ascii")
        self._version = self._parser.get_http_version()
        # HTTP/1.0 clients expect a header for keep-alive, which this server does not send.
        self.keep_alive = self._parser.should_keep_alive() and self._version == "1.1"
        headers = dict(self._headers)
        self.body_bytes: int | None = int(headers.get(b"content-length", 0))
        if b"transfer-encoding" in headers:
            self._check_chunked()
            self.body_bytes = None
        self.expects = headers.get(b"expect", b"").lower() == b"100-continue"

    def _check_chunked(self) -> None:
        """Refuse a body of which a proxy in front of this server may see another end."""
        framing = [h for h in self._headers if h[0] in (b"transfer-encoding", b"content-length")]
        chunked = len(framing) == 1 and framing[0][1].strip(b" \t").lower() == b"chunked"
        if not chunked or self._version != "1.1":
            raise HttpParserError("it does not say in one way where it ends")

    def _environ(self) -> dict:
        path, query = self._target()
        environ = {
            "REQUEST_METHOD": self.method,
            "PATH_INFO": unquote_to_bytes(path).decode("latin-1"),
            "QUERY_STRING": query.decode("latin-1"),
            "SERVER_PROTOCOL": f"HTTP/{self._version}",
        }
        for name, value in self._headers:
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
        if self._url.startswith(b"/"):
            path, _, query = self._url.partition(b"?")
            return path, query
        # An absolute URL, as clients send it to a proxy.
        url = parse_url(self._url)
        return url.path or b"/", url.query or b""
