"""Break off what a thread does in an environment, once nobody waits for it any more."""

from __future__ import annotations

import ctypes


# A thread that ends by one of this kind ends without a word.
class Interrupted(SystemExit):
    """Raised in a thread whose call was given up, wherever its Python code just is."""


def interrupt(thread: int) -> None:
    """Raise ``Interrupted`` in a thread that has been answered for.

    It comes at the next step of Python code: a loop ends at once, a call into C that never comes
    back does not. Whoever calls this must know that the thread has not gone on to other things.

    Args:
        thread: its identity.
    """
    ctypes.pythonapi.PyThreadState_SetAsyncExc(
        ctypes.c_ulong(thread), ctypes.py_object(Interrupted)
    )
