"""Interrupt a thread in an environment when nobody waits for its result any more."""

from __future__ import annotations

import contextlib
import ctypes
import threading
from collections.abc import Callable, Iterator

_lock = threading.Lock()
# By the thread that they interrupt.
_break_offs: dict[int, Callable[[], object]] = {}


@contextlib.contextmanager
def interrupted_by(break_off: Callable[[], object]) -> Iterator[None]:
    """Let an interrupt of this thread call a function, and raise ``SystemExit`` only at the end.

    Use it for work that must not end halfway, or that waits for something that no exception ends.

    Args:
        break_off: makes the thread reach the end soon; runs in the interrupting thread.
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

    Python raises it at the thread's next step of Python code: it ends a loop at once, but not a C
    call that never returns. The caller must know that the thread has not moved on to other work.

    Args:
        thread: the thread's identity.
    """
    with _lock:
        break_off = _break_offs.pop(thread, None)
        if break_off is None:
            ctypes.pythonapi.PyThreadState_SetAsyncExc(
                ctypes.c_ulong(thread), ctypes.py_object(SystemExit)
            )
    if break_off is not None:
        break_off()
