"""Break off what a thread does in an environment, once nobody waits for its result any more."""

from __future__ import annotations

import contextlib
import ctypes
import threading
from collections.abc import Callable, Iterator

_lock = threading.Lock()
# By the thread that is to be interrupted by them.
_break_offs: dict[int, Callable[[], object]] = {}


@contextlib.contextmanager
def interrupted_by(break_off: Callable[[], object]) -> Iterator[None]:
    """Let an interrupt of this thread call a function, and raise ``SystemExit`` only at the end.

    For what must not end halfway, or waits for something that no exception breaks off.

    Args:
        break_off: lets the thread get to the end soon; called in the thread that interrupts.
    """
    thread = threading.get_ident()
    with _lock:
        _break_offs[thread] = break_off
    try:
        yield
    finally:
        with _lock:
            was_interrupted = _break_offs.pop(thread, None) is None
        if was_interrupted:
            raise SystemExit


def interrupt(thread: int) -> None:
    """Raise ``SystemExit`` in a thread whose work was abandoned, so that it ends silently.

    The exception comes at the next step of Python code: a loop ends at once, a call into C that
    never comes back does not. The caller must know that the thread has not gone on to other work.

    Args:
        thread: its identity.
    """
    with _lock:
        break_off = _break_offs.pop(thread, None)
        if break_off is None:
            ctypes.pythonapi.PyThreadState_SetAsyncExc(
                ctypes.c_ulong(thread), ctypes.py_object(SystemExit)
            )
    if break_off is not None:
        break_off()
