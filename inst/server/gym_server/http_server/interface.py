"""What passes between the server and the program that uses it: answers, memory for bodies."""

from __future__ import annotations

from collections.abc import Callable
from http import HTTPStatus
from typing import Protocol

# A status such as "200 OK" and headers, as an application gives them to WSGI, and the body.
Answer = tuple[str, list[tuple[str, str]], bytes]

# Makes the answer to a request that does not reach the application, of a status (400, 413 or 503)
# and, for 400, what is wrong with it.
Refuse = Callable[[int, str], Answer]

_RETRY_SECONDS = 5


class Share(Protocol):
    """The memory that the bodies of one connection's requests hold."""

    def take(self, size: int) -> bool:
        """Take so many bytes more; return whether as many were left."""

    def give_back(self, size: int) -> None:
        """Give back so many bytes."""

    def give_all_back(self) -> None:
        """Give back all bytes."""


class Budget(Protocol):
    """The memory that the bodies of all requests may hold together."""

    def share(self) -> Share:
        """Return the share of one connection, which holds nothing yet."""


def refuse_in_plain_text(status: int, reason: str) -> Answer:
    """Answer a request that does not reach the application; the default of ``Refuse``."""
    phrase = HTTPStatus(status).phrase
    body = f"{reason or phrase}\n".encode()
    headers = [("Content-Type", "text/plain; charset=utf-8"), ("Content-Length", str(len(body)))]
    if status == HTTPStatus.SERVICE_UNAVAILABLE:
        headers.append(("Retry-After", str(_RETRY_SECONDS)))
    return f"{status} {phrase}", headers, body
