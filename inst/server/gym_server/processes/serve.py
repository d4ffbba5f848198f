"""What a worker process runs: functions of the server, one call after another."""

from __future__ import annotations

import contextlib
import faulthandler
import importlib
import os
import pickle
import signal
from collections.abc import Callable
from functools import cache
from multiprocessing.connection import Connection
from typing import Any, cast

from gym_server import logs
from gym_server.errors import GymServerError, environment_error, logged
from gym_server.processes import start
from gym_server.processes.messages import result_message
from gym_server.processes.pipe import Pipe

# The progress of the running function, visible to the server; see ``WorkerProcess``.
progress: Any = [0, 0]


def serve(calls: Connection, shared_progress: Any) -> None:
    """Call functions, one after another, until the server closes the pipe or ends.

    Args:
        calls: receives one call after another.
        shared_progress: two integers that the server can read.
    """
    global progress
    _set_up()
    progress = memoryview(shared_progress).cast("B").cast("q")
    pipe = Pipe(calls)
    while True:
        try:
            name, args = pickle.loads(pipe.receive())
        except (EOFError, OSError):
            return
        message = _answer(name, args)
        try:
            pipe.send(message)
        except (OSError, ValueError):
            os._exit(1)


def _set_up() -> None:
    """Make this process end with the server and log as the server does."""
    if hasattr(os, "setsid"):
        # So that processes which the environment starts can be killed with it, and Ctrl-C reaches
        # only the server.
        os.setsid()
    for name in ("SIGINT", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    start.end_group_with_parent()
    logs.set_up(" (process %(process)d)")
    with contextlib.suppress(OSError, ValueError, AttributeError):
        # Print where C code crashed.
        faulthandler.enable()


def _answer(name: str, args: tuple) -> bytes:
    try:
        return result_message(_function(name)(*args))
    except GymServerError as refusal:
        return result_message(None, logged(refusal))
    except BaseException as failure:
        return result_message(None, logged(environment_error(failure)))


@cache
def _function(name: str) -> Callable:
    module, _, function = name.partition(":")
    return cast(Callable, getattr(importlib.import_module(module), function))
