"""What the application tells the HTTP server."""

from __future__ import annotations

import socket
from collections.abc import Callable
from typing import NamedTuple

JSON = "application/json"


class Response(NamedTuple):
    """A response in HTTP's words; the server adds the Content-Length.

    Attributes:
        status: such as 200.
        body: what follows the head.
        content_type: the body's.
        headers: all others, as names and values.
        take_over: with status 101, speaks another protocol on the connection: called, after the
            head was sent, by the connection's thread with its socket, which blocks without a
            timeout, and what the client has sent since. The socket is closed when it returns or
            raises OSError. A stop of the server ends what the socket receives.
    """

    status: int
    body: bytes
    content_type: str = JSON
    headers: tuple[tuple[str, str], ...] = ()
    take_over: Callable[[socket.socket, bytes], None] | None = None


class Admission(NamedTuple):
    """How a request is answered whose head has arrived.

    Attributes:
        respond: answers the request, given its body and a function that returns whether the client
            still waits; never raises.
        is_known: whether the client may stay connected; others have little time.
        lasts: whether it also holds for later requests with the same head on the connection; others
            have small bodies only.
    """

    respond: Callable[[bytes, Callable[[], bool]], Response]
    is_known: bool = True
    lasts: bool = True
