"""The token that requests must carry, new or as it is given, never on the command line."""

from __future__ import annotations

import logging
import os
import re
import secrets
import stat
from collections.abc import MutableMapping
from pathlib import Path

log = logging.getLogger(__name__)

VARIABLE = "GYM_SERVER_TOKEN"

# What a token may consist of, so that it fits into a header and is not guessed.
_TOKEN = re.compile("[!-~]{16,1024}")


class BadTokenError(Exception):
    """What was given cannot be a token; the message does not show it."""


def find_token(file: Path | None, environ: MutableMapping[str, str]) -> str | None:
    """Return the server's token, None where there is none.

    Args:
        file: holds it; None to look at the variable GYM_SERVER_TOKEN.
        environ: the process's variables; the token's is taken out, so that no process that an
            environment starts inherits it.

    Raises:
        BadTokenError: what was given cannot be a token.
        OSError: the file cannot be read.
    """
    of_variable = environ.pop(VARIABLE, "")
    if file is not None:
        _warn_of_readers(file)
        return _checked(file.read_bytes().decode("ascii", "replace"), f"the file {file}")
    return _checked(of_variable, f"the variable {VARIABLE}") if of_variable else None


def new_token() -> str:
    """Return a token that nobody can guess."""
    return secrets.token_urlsafe(32)


def _checked(text: str, place: str) -> str:
    token = text.strip()
    if _TOKEN.fullmatch(token) is None:
        raise BadTokenError(
            f"{place} must hold one token of 16 to 1,024 visible ASCII characters, and "
            f"what it holds {_fault(token)}"
        )
    return token


def _fault(token: str) -> str:
    if len(token) < 16:
        return f"has {len(token)}"
    return "has more" if len(token) > 1024 else "has others"


def _warn_of_readers(file: Path) -> None:
    # On Windows these bits do not say who may read a file.
    if os.name == "posix" and file.stat().st_mode & stat.S_IROTH:
        log.warning("Everybody on this machine can read the token in %s (chmod 600 fixes it)", file)
