"""Processes of the server's own: how they start, and that none outlives it."""

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
from multiprocessing.context import BaseContext

# A forkserver copies a process that has only just imported what all of them need; Windows has
# none.  Never a fork: it would copy locks that other threads hold, and our signals.
START_METHOD = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"

_PRELOADED = ["gym_server.isolation.worker"]


def context() -> BaseContext:
    """Return what starts processes."""
    context = multiprocessing.get_context(START_METHOD)
    context.set_forkserver_preload(_PRELOADED)
    with _first:
        _temporary_folder()
    return context


_first = threading.Lock()


@cache
def _temporary_folder() -> str:
    """Return the folder of the sockets that processes are started by, for all of them.

    Each process that starts others makes one, unless it has got one from the process that started
    it. So the server's is made first: those that are killed would leave theirs behind.
    """
    return util.get_temp_dir()


def remove_temporary_folder() -> None:
    """Remove what an ordinary exit removes by itself, before one that is not."""
    if _temporary_folder.cache_info().currsize:
        shutil.rmtree(_temporary_folder(), ignore_errors=True)


def end_with_the_server(group: bool = False) -> None:
    """End this process when the one that started it ends, however that comes about.

    Args:
        group: whether all others of its process group end, too.
    """
    server = multiprocessing.parent_process()
    if server is None:
        return
    if group and sys.platform == "linux":
        _be_killed_by(server.sentinel)

    def end() -> None:
        server.join()
        if group:
            with contextlib.suppress(OSError, AttributeError):
                os.killpg(os.getpid(), signal.SIGKILL)
        os._exit(1)

    threading.Thread(target=end, daemon=True).start()


def _be_killed_by(sentinel: int) -> None:
    """Let the system end this process group when the other end of a pipe closes.

    That needs no thread: code that never lets another one run would keep it from its work.
    """
    import fcntl

    fcntl.fcntl(sentinel, fcntl.F_SETSIG, signal.SIGKILL)
    fcntl.fcntl(sentinel, fcntl.F_SETOWN, -os.getpgrp())
    flags = fcntl.fcntl(sentinel, fcntl.F_GETFL)
    fcntl.fcntl(sentinel, fcntl.F_SETFL, flags | fcntl.FASYNC)
