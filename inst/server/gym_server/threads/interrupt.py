"""Break off what a thread does in an environment, once nobody waits for its result any more."""

from __future__ import annotations

import ctypes


def interrupt(thread: int) -> None:
    """Raise ``SystemExit`` in a thread whose work was abandoned, so that it ends silently.

    The exception comes at the next step of Python code: a loop ends at once, a call into C that
    never comes back does not. The caller must know that the thread has not gone on to other work.

    Args:
        thread: its identity.
    """
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(SystemExit))
