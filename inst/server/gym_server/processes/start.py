"""How the server starts processes, and makes sure that none outlives it."""

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
# Windows has none.  The server itself is never forked: a copy would have locks that other threads
# hold, and our signal handlers.
START_METHOD = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"

_preloaded: list[str] = []


def preload(module: str) -> None:
    """Let processes start with a module imported, where the system can copy one that has it.

    Call it before the first process starts.
    """
    _preloaded.append(module)


# A process for each core is what there is for more than one core: threads of NumPy's beside them
# would wait for each other. Read when NumPy is imported, so this process keeps its own.
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def context() -> Any:
    """Return the ``multiprocessing`` context that starts processes."""
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
    """Return the folder of the sockets over which processes are started.

    A process that starts others makes such a folder unless it inherits one. The server makes its
    folder before it starts any process, so that all share this one: a process that is killed
    would leave a folder of its own behind.
    """
    return util.get_temp_dir()


def remove_temporary_folder() -> None:
    """Remove the folder, which an ordinary exit does by itself, before ``os._exit()``."""
    if _temporary_folder.cache_info().currsize:
        shutil.rmtree(_temporary_folder(), ignore_errors=True)


def exit_with_parent(group: bool = False) -> None:
    """Let this process exit when the process that started it ends, in whatever way.

    Args:
        group: whether all other processes of its group are killed, too.
    """
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    if group and sys.platform == "linux":
        _kill_group_at_end_of(parent.sentinel)

    def exit_after_parent() -> None:
        parent.join()
        if group:
            with contextlib.suppress(OSError, AttributeError):
                os.killpg(os.getpid(), signal.SIGKILL)
        os._exit(1)

    threading.Thread(target=exit_after_parent, daemon=True).start()


def _kill_group_at_end_of(sentinel: int) -> None:
    """Let the system kill this process group when the other end of a pipe closes.

    That needs no thread of Python's, which code in C that keeps the interpreter's lock would stop.
    """
    import fcntl

    fcntl.fcntl(sentinel, fcntl.F_SETSIG, signal.SIGKILL)
    fcntl.fcntl(sentinel, fcntl.F_SETOWN, -os.getpgrp())
    flags = fcntl.fcntl(sentinel, fcntl.F_GETFL)
    fcntl.fcntl(sentinel, fcntl.F_SETFL, flags | fcntl.FASYNC)
