"""What a token looks like, so that it fits into a header and cannot be guessed."""

from __future__ import annotations

import re

_TOKEN = re.compile("[!-~]{16,1024}")


class CannotStartError(Exception):
    """The server cannot start as it was asked to; the message says why, and has no token."""


def check(token: str, place: str, hint: str = "") -> None:
    """Raise ``CannotStartError`` if a text in a place is no token."""
    if _TOKEN.fullmatch(token):
        return
    found = "more" if len(token) > 1024 else "other characters"
    if len(token) < 16:
        found = f"{len(token)}"
    raise CannotStartError(
        f"{place} must have a token of 16 to 1,024 visible ASCII characters, but it has "
        f"{found}{hint}"
    )
