"""Logging of the server and its processes: to standard error, with short messages.

An exception from an environment may repeat everything that a client sent, any number of times.
"""

from __future__ import annotations

import contextlib
import logging
import re
import threading
import time
import traceback
import warnings
from collections.abc import Hashable, Iterator
from types import CodeType, TracebackType
from typing import TextIO

from gym_server.json_values import LONGEST_MESSAGE, shortened

_log = logging.getLogger("py.warnings")

_LONGEST_TRACEBACK = 20_000

# After a warning, or a traceback from one place, the same is left out for this long. An environment
# may warn at each step.
_QUIET_SECONDS = 60.0

_Place = tuple[CodeType, int] | None


def set_up(level: str | int, about_process: str = "") -> None:
    """Log to standard error.

    Args:
        level: the lowest level to log.
        about_process: what each line says about its process, as a ``logging`` format.
    """
    handler = logging.StreamHandler()
    handler.setFormatter(
        Formatter(f"%(asctime)s %(levelname)s %(name)s{about_process}: %(message)s")
    )
    logging.basicConfig(level=level, handlers=[handler])
    # Each time, and not once in the life of a process: each client is to get them.
    warnings.filterwarnings("always", _GYMNASIUM)
    # Gymnasium's recorder finds the directory that a monitor has made for it.
    warnings.filterwarnings("ignore", f"{_GYMNASIUM}Overwriting existing videos")
    warnings.showwarning = _show_warning


# How Gymnasium's warnings begin: it colours them.
_GYMNASIUM = r"(\x1b\[\d+m)?WARN: "


class _Heard(threading.local):
    texts: list[str] | None = None


_heard = _Heard()


@contextlib.contextmanager
def hearing() -> Iterator[list[str]]:
    """Collect the warnings of Gymnasium that this thread causes meanwhile."""
    texts: list[str] = []
    _heard.texts = texts
    try:
        yield texts
    finally:
        _heard.texts = None


def hear(text: str) -> None:
    """Add a warning to those that are collected."""
    if _heard.texts is not None and text not in _heard.texts:
        _heard.texts.append(text)


# When each warning was logged last.
_warned: dict[str, float] = {}


def _is_new(what: Hashable, logged: dict) -> bool:
    """Return whether something was not logged recently, and note that it is now."""
    now = time.monotonic()
    for old in [one for one, at in list(logged.items()) if at <= now - _QUIET_SECONDS]:
        logged.pop(old, None)
    is_new = what not in logged
    if is_new:
        logged[what] = now
    return is_new


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    text = re.sub(r"\x1b\[\d+m", "", str(message))
    if _is_new(text, _warned):
        _log.warning("%s:%s: %s: %s", filename, lineno, category.__name__, text)
    if re.match(_GYMNASIUM, str(message)):
        hear(text.removeprefix("WARN: "))


class Formatter(logging.Formatter):
    """Shortens messages, and leaves out repeated tracebacks."""

    def __init__(self, form: str) -> None:
        """Set the format of a line."""
        super().__init__(form)
        # The time of the last traceback from each place.
        self._logged: dict[_Place, float] = {}

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802
        """Return a line; see ``logging.Formatter``."""
        record.message = shortened(record.message, LONGEST_MESSAGE)
        return super().formatMessage(record)

    def formatException(self, ei: tuple) -> str:  # noqa: N802
        """Return a traceback, unless one from the same place was logged recently."""
        error: BaseException = ei[1]
        place = _place((error.__cause__ or error).__traceback__)
        if not _is_new(place, self._logged):
            return "(The traceback of this place was logged less than a minute ago)"
        # A part is a line of code or the message of an error.
        parts = traceback.TracebackException(*ei).format()
        text = "".join(f"{shortened(part.rstrip(), LONGEST_MESSAGE)}\n" for part in parts)
        return shortened(text.rstrip(), _LONGEST_TRACEBACK)


def _place(trace: TracebackType | None) -> _Place:
    """Return where an error was raised."""
    if trace is None:
        return None
    *_, (frame, line) = traceback.walk_tb(trace)
    return frame.f_code, line
