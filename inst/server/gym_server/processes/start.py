"""Start processes so that none outlives the server."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import shutil
import signal
import sys
import threading
from functools import cache
from multiprocessing import util
from typing import Any

# A fork server forks a process that has imported the preloaded modules and does nothing else;
# Windows has none. The server itself is never forked: a copy would hold locks of other threads, and
# would have its signal handlers.
START_METHOD = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"

_preloaded: list[str] = []


def preload(module: str) -> None:
    """Start processes with a module already imported, if the system can fork.

    Call it before the first process starts.
    """
    _preloaded.append(module)


# There is one process per core, so further NumPy threads would only wait for each other. NumPy
# reads these when it is imported, so this process is not affected.
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def context() -> Any:
    """Return the ``multiprocessing`` context for starting processes."""
    context = multiprocessing.get_context(START_METHOD)
    for name in _ONE_THREAD:
        os.environ.setdefault(name, "1")
    context.set_forkserver_preload(_preloaded)
    with _folder_lock:
        _temporary_folder()
    return context


_folder_lock = threading.Lock()


@cache
def _temporary_folder() -> str:
    """Return the folder of the sockets that are used to start processes.

    A process that starts others creates such a folder unless it inherits one. The server creates
    its folder before it starts any process, so all share it. A process that is killed would leave
    its own folder behind.
    """
    return util.get_temp_dir()


def remove_temporary_folder() -> None:
    """Remove the folder before ``os._exit()``; an ordinary exit removes it by itself."""
    if _temporary_folder.cache_info().currsize:
        shutil.rmtree(_temporary_folder(), ignore_errors=True)


def end_group_with_parent() -> None:
    """Make this process and all others of its group end when its parent ends, however it ends."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    if sys.platform == "linux":
        _kill_group_at_end_of(parent.sentinel)

    def exit_after_parent() -> None:
        parent.join()
        with contextlib.suppress(OSError, AttributeError):
            os.killpg(os.getpid(), signal.SIGKILL)
        os._exit(1)

    threading.Thread(target=exit_after_parent, daemon=True).start()


def _kill_group_at_end_of(sentinel: int) -> None:
    """Let the system kill this process group when the other end of a pipe closes.

    This works even while C code holds the GIL, which would stop a thread.
    """
    import fcntl

    fcntl.fcntl(sentinel, fcntl.F_SETSIG, signal.SIGKILL)
    fcntl.fcntl(sentinel, fcntl.F_SETOWN, -os.getpgrp())
    flags = fcntl.fcntl(sentinel, fcntl.F_GETFL)
    fcntl.fcntl(sentinel, fcntl.F_SETFL, flags | fcntl.FASYNC)
