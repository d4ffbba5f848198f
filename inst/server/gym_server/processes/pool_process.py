"""A process of the pool: it runs functions of the server's own, one call after the other.

What it runs would otherwise run in the server's own process, so the server trusts it as it trusts
itself, and both send Python's objects; unless it was started for an environment that is not
trusted.
"""

from __future__ import annotations

import contextlib
import importlib
import logging
import os
from collections.abc import Callable
from functools import cache
from multiprocessing.connection import Connection
from typing import Any, cast

from gym_server.errors import GymServerError, answer_to, environment_error, shutting_down
from gym_server.processes import start
from gym_server.processes.messages import (
    Result,
    answer_message,
    object_message,
    read_call,
    refusal_message,
    value_message,
)
from gym_server.processes.pipe import Pipe
from gym_server.processes.set_up import set_up_process
from gym_server.processes.worker_process import WorkerProcess
from gym_server.protocol.answers import Ready

# As ``nice`` has it; no process may take that back.
_LOWER_PRIORITY = 5

# In the process -----------------------------------------------------------------------------

# What the process's function is doing, for the server to see meanwhile; see ``PoolProcess``.
progress: Any = [0, 0]


def serve(
    calls: Connection, _: Connection, log_level: int, most_mb: int, shared_progress: Any
) -> None:
    """Call one function after the other, until the server closes the pipe or is gone."""
    global progress
    set_up_process(log_level, most_mb)
    progress = memoryview(shared_progress).cast("B").cast("q")
    pipe = Pipe(calls)
    while True:
        try:
            number, name, args = read_call(pipe.receive())
        except (EOFError, OSError):
            os._exit(0)
        message = _answer(number, name, args)
        try:
            pipe.send(message)
        except (OSError, ValueError):
            os._exit(1)


def _answer(number: int, name: str, args: tuple) -> bytes:
    try:
        result = _function(name)(*args)
        if isinstance(result, Ready):
            return answer_message(number, result)
        if isinstance(result, Result):
            return value_message(number, *result)
        return object_message(number, result)
    except GymServerError as refusal:
        return refusal_message(number, answer_to(refusal)[1])
    except BaseException as failure:
        return refusal_message(number, answer_to(environment_error(failure))[1])


@cache
def _function(name: str) -> Callable:
    module, _, function = name.partition(":")
    return cast(Callable, getattr(importlib.import_module(module), function))


# In the server ------------------------------------------------------------------------------


class PoolProcess:
    """A process that runs the functions of a module; when it is taken again, of another one.

    Attributes:
        module: the name of the module.
        on_end: called with the reason when it ends without having been asked to.
        progress: two integers that its function may set while it runs.
        gives_way: whether it gives way to other processes.
    """

    def __init__(self, most_mb: int = 0, trusted: bool = True) -> None:
        """Start it.

        Args:
            most_mb: how much memory the system lets it have, in MiB; 0 for no limit.
            trusted: whether it may return any objects of Python's; see ``messages``.
        """
        self.module = ""
        self.gives_way = False
        self.on_end: Callable[[GymServerError], None] = lambda why: None
        self.progress = start.context().RawArray("q", 2)
        self._worker = WorkerProcess(
            serve,
            logging.getLogger().level,
            most_mb,
            self.progress,
            on_end=lambda why: self.on_end(why),
            hint="",
            trusted=trusted,
        )

    @property
    def pid(self) -> int:
        """Its number."""
        return self._worker.pid

    @property
    def is_alive(self) -> bool:
        """Whether it has not ended."""
        return self._worker.why is None

    def begin(self, function: str, *args: object) -> None:
        """Begin a call of one of its module's functions; ``finish()`` must follow.

        Raises:
            GymServerError: ``environment_died``, or why it was killed.
        """
        self._worker.begin(f"{self.module}:{function}", *args)

    def finish(self) -> Any:
        """Return the result of the call that has begun.

        Raises:
            GymServerError: what the function refused with, or as ``begin()``.
        """
        result = self._worker.finish()
        return result.value if isinstance(result, Result) else result

    def give_way(self) -> None:
        """Give way to other processes from now on, the server's own among them, for good."""
        if not self.gives_way and hasattr(os, "setpriority"):
            with contextlib.suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, self.pid, _LOWER_PRIORITY)
        self.gives_way = True

    def report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        """From now on report when it ends by itself, or at once if it has."""
        self.on_end = on_end
        self._worker.report_end()

    def release(self) -> None:
        """Take its end from now on for one that nobody needs to know of."""
        self._worker.begin_close()
        self.on_end = lambda why: None

    def kill(self, why: GymServerError | None = None) -> None:
        """End it at once; a call that waits for it raises the reason."""
        self._worker.kill(why or shutting_down())
