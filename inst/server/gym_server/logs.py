"""Logging of the server and its processes: to standard error; and Gymnasium's warnings."""

from __future__ import annotations

import contextlib
import functools
import logging
import re
import threading
import warnings
from collections.abc import Iterator
from typing import TextIO

# How Gymnasium's warnings begin: it colours them.
_GYMNASIUM = r"(\x1b\[\d+m)?WARN: "


def set_up(about_process: str = "") -> None:
    """Log to standard error.

    Args:
        about_process: what each line says about its process, as a ``logging`` format.
    """
    form = f"%(asctime)s %(levelname)s %(name)s{about_process}: %(message)s"
    logging.basicConfig(level=logging.INFO, format=form)
    # Each time, and not once in the life of a process: each client is to get them.
    warnings.filterwarnings("always", _GYMNASIUM)
    # Gymnasium's recorder finds the directory that a monitor has made for it.
    warnings.filterwarnings("ignore", f"{_GYMNASIUM}Overwriting existing videos")
    warnings.showwarning = _show_warning


@functools.lru_cache(maxsize=256)
def warn_once(logger: str, message: str) -> None:
    """Log a warning, unless it was logged before: an environment may give one at each step."""
    logging.getLogger(logger).warning("%s", message)


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


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    text = re.sub(r"\x1b\[\d+m", "", str(message))
    warn_once("py.warnings", f"{filename}:{lineno}: {category.__name__}: {text}")
    if re.match(_GYMNASIUM, str(message)):
        hear(text.removeprefix("WARN: "))
