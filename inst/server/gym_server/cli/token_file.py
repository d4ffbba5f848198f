"""The token that requests must have; it is never on the command line."""

from __future__ import annotations

import logging
import os
import stat
from collections.abc import MutableMapping
from pathlib import Path

from gym_server import tokens

log = logging.getLogger(__name__)

VARIABLE = "GYM_SERVER_TOKEN"


def find_token(file: Path | None, environ: MutableMapping[str, str]) -> str | None:
    """Return the server's token, or None.

    Args:
        file: the file with the token; None to use the variable GYM_SERVER_TOKEN.
        environ: the environment variables. The token is removed, so that processes that an
            environment starts do not inherit it.

    Raises:
        CannotStartError: the token is not valid.
        OSError: the file cannot be read.
    """
    of_variable = environ.pop(VARIABLE, "")
    if file is not None:
        _warn_of_readers(file)
        return _checked(file.read_bytes().decode("ascii", "replace"), f"the file {file}")
    return _checked(of_variable, f"the variable {VARIABLE}") if of_variable else None


def _checked(text: str, place: str) -> str:
    token = text.strip()
    tokens.check(token, place)
    return token


def _warn_of_readers(file: Path) -> None:
    # On Windows these bits do not show who may read a file.
    if os.name == "posix" and file.stat().st_mode & stat.S_IROTH:
        log.warning("Everybody on this machine can read the token in %s (chmod 600 fixes it)", file)
