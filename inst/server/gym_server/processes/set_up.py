"""The first steps of a process that the server started."""

from __future__ import annotations

import contextlib
import faulthandler
import os
import signal

from gym_server import logs
from gym_server.processes import start


def set_up_process(log_level: int) -> None:
    """Make this process end with the server and log as the server does.

    Args:
        log_level: the lowest level to log to standard error.
    """
    if hasattr(os, "setsid"):
        # So that processes which the environment starts can be killed with it, and Ctrl-C reaches
        # only the server.
        os.setsid()
    for name in ("SIGINT", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    start.exit_with_parent(group=True)
    logs.set_up(log_level, " (process %(process)d)")
    with contextlib.suppress(OSError, ValueError, AttributeError):
        # Print where C code crashed.
        faulthandler.enable()
