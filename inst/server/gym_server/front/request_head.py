"""What the front reads of a connection's first request."""

from __future__ import annotations

import re
from typing import NamedTuple
from urllib.parse import parse_qs

# The size of the largest head.
LARGEST_BYTES = 2**14

_BEGINNING = re.compile(rb"[\r\n]*[A-Z]")
_REQUEST_LINE = re.compile(rb"([A-Z]+) ([!-~]+) HTTP/1\.[01]")


class BadHeadError(Exception):
    """The bytes are not the head of a request."""


class RequestHead(NamedTuple):
    """The parts of a head that say where its connection goes.

    Attributes:
        method: such as "GET".
        path: of the URL.
        token: that of the header "Authorization: Bearer", or None.
        key: the watch page's key in the URL, or "".
    """

    method: str
    path: str
    token: bytes | None
    key: str


def read_head(data: bytes) -> RequestHead | None:
    """Read a head.

    Args:
        data: what has arrived.

    Returns:
        Its parts; None if it is not complete.

    Raises:
        BadHeadError: it is not a head, or too long.
    """
    if data and not _BEGINNING.match(data):
        raise BadHeadError("it is not HTTP")
    # A request may follow an empty line.
    head, end, _ = data.lstrip(b"\r\n").partition(b"\r\n\r\n")
    if len(head) >= LARGEST_BYTES:
        raise BadHeadError(f"its head has more than {LARGEST_BYTES} bytes")
    if not end:
        return None
    first, *lines = head.split(b"\r\n")
    parts = _REQUEST_LINE.fullmatch(first)
    if parts is None:
        raise BadHeadError("its first line is not that of a request")
    path, _, query = parts[2].decode("ascii").partition("?")
    given = [
        value.strip()
        for name, _, value in (line.partition(b":") for line in lines)
        if name.lower() == b"authorization"
    ]
    scheme, _, token = given[0].partition(b" ") if len(given) == 1 else (b"", b"", b"")
    key = parse_qs(query).get("key", [""])[0]
    is_bearer = scheme.lower() == b"bearer"
    return RequestHead(parts[1].decode("ascii"), path, token.strip() if is_bearer else None, key)
