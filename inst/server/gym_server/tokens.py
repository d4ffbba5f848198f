"""What a token looks like, so that it fits into a header and cannot be guessed."""

from __future__ import annotations

import re

_TOKEN = re.compile("[!-~]{16,1024}")

WANTED = "16 to 1,024 visible ASCII characters"


def fault(token: str) -> str | None:
    """Return what a token has instead of ``WANTED``, without repeating it; None if it is one."""
    if _TOKEN.fullmatch(token):
        return None
    if len(token) < 16:
        return f"{len(token)}"
    return "more" if len(token) > 1024 else "other characters"
