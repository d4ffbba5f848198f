"""A response, as it goes out and is stored for a repetition of its request."""

from __future__ import annotations

from typing import NamedTuple

JSON = "application/json"


class Response(NamedTuple):
    """A response in HTTP's words; the length of its body is the server's to tell."""

    status: int
    body: bytes
    content_type: str = JSON
    headers: tuple[tuple[str, str], ...] = ()
