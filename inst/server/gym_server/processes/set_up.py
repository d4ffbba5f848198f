"""What a process that the server has started does first."""

from __future__ import annotations

import contextlib
import faulthandler
import os
import signal

from gym_server import logs
from gym_server.processes import start

# What a process may have beside its environments: modules, and pictures by OpenGL.
OWN_MB = 512


def set_up_process(log_level: int, max_mb: int = 0) -> None:
    """Become a process that ends with the server, logs as it does, and has a memory limit.

    Args:
        log_level: what goes to standard error.
        max_mb: how much memory the process may have, in MiB; 0 for no limit.
    """
    if hasattr(os, "setsid"):
        # The processes that the environment starts can be killed with it, and Ctrl-C reaches the
        # server only.
        os.setsid()
    for name in ("SIGINT", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    start.exit_with_parent(group=True)
    logs.set_up(log_level, " (process %(process)d)")
    with contextlib.suppress(OSError, ValueError, AttributeError):
        # A crash in C prints where it happened.
        faulthandler.enable()
    if max_mb:
        _limit_memory(max_mb * 2**20)


def _limit_memory(size: int) -> None:
    # Not RLIMIT_AS: threads and libraries reserve addresses that they never use.
    import resource

    resource.setrlimit(resource.RLIMIT_DATA, (size, size))
