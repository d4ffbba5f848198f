"""A response, as it is sent, and stored in case its request is repeated."""

from __future__ import annotations

from typing import NamedTuple

JSON = "application/json"


class Response(NamedTuple):
    """A response in HTTP's words; the server adds the Content-Length."""

    status: int
    body: bytes
    content_type: str = JSON
    headers: tuple[tuple[str, str], ...] = ()
