"""Break off what a thread does in an environment, once nobody waits for it any more."""

from __future__ import annotations

import ctypes


def interrupt(thread: int) -> None:
    """Raise ``SystemExit``, by which a thread ends without a word, in one that was answered for.

    It comes at the next step of Python code: a loop ends at once, a call into C that never comes
    back does not. Whoever calls this must know that the thread has not gone on to other things.

    Args:
        thread: its identity.
    """
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(SystemExit))
