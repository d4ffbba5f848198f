"""The calls of environments that this process is running, so that one that hangs can be found."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from threading import get_ident

# By thread: since when, in the clock's seconds, and a function that describes the call.
running: dict[int, tuple[float, Callable[[], str]]] = {}


@contextlib.contextmanager
def call(describe: Callable[[], str]) -> Iterator[None]:
    """Run a call of an environment in this thread.

    Args:
        describe: returns what it does, as the subject of a sentence.
    """
    running[get_ident()] = time.monotonic(), describe
    try:
        yield
    finally:
        running.pop(get_ident(), None)


@contextlib.contextmanager
def waiting() -> Iterator[Callable[[], str] | None]:
    """Leave out this thread's call while it waits for a thread or process that is watched itself.

    Yields:
        The function that describes the call; None if this thread runs none.
    """
    _, describe = running.pop(get_ident(), (0.0, None))
    try:
        yield describe
    finally:
        if describe is not None:
            running[get_ident()] = time.monotonic(), describe


def overdue(seconds: float) -> str | None:
    """Describe a call that has run for longer than some seconds; None if there is none."""
    before = time.monotonic() - seconds
    return next((what() for since, what in list(running.values()) if since < before), None)
