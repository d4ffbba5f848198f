"""Processes of the server's own: how they start, and that none outlives it."""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import signal
import sys
import threading
from multiprocessing.context import BaseContext

# A forkserver copies a process that has only just imported what all of them need; Windows has
# none.  Never a fork: it would copy locks that other threads hold, and our signals.
START_METHOD = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"

_PRELOADED = ["gym_server.worker"]

_PR_SET_PDEATHSIG = 1


def context() -> BaseContext:
    """Return what starts processes."""
    context = multiprocessing.get_context(START_METHOD)
    context.set_forkserver_preload(_PRELOADED)
    return context


def end_with_the_server(group: bool = False) -> None:
    """End this process when the one that started it ends, however that comes about.

    Args:
        group: whether all others of its process group end, too.
    """
    server = multiprocessing.parent_process()
    if server is None:
        return
    if group and sys.platform == "linux":
        # Also when code that never lets another thread run keeps the one below from its work.
        # (The forkserver, whose child this is, ends with the server.)
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)

    def end() -> None:
        server.join()
        if group:
            with contextlib.suppress(OSError, AttributeError):
                os.killpg(os.getpid(), signal.SIGKILL)
        os._exit(1)

    threading.Thread(target=end, daemon=True).start()
