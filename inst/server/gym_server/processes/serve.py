"""What a worker process runs: functions of the server, one call after another."""

from __future__ import annotations

import importlib
import os
import threading
from collections.abc import Callable
from functools import cache
from multiprocessing.connection import Connection
from typing import Any, cast

from gym_server.errors import GymServerError, answer_to, environment_error
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
from gym_server.protocol.answers import Ready

# The progress of the running function, visible to the server; see ``WorkerProcess``.
progress: Any = [0, 0]


def serve(
    calls: Connection, queries: Connection, log_level: int, most_mb: int, shared_progress: Any
) -> None:
    """Call functions, one after another, until the server closes the pipe or ends.

    Args:
        calls: receives one call after another.
        queries: receives calls that are answered while another one runs.
        log_level: the lowest level to log to standard error.
        most_mb: the memory limit of this process in MiB; 0 for no limit.
        shared_progress: two integers that the server can read.
    """
    global progress
    set_up_process(log_level, most_mb)
    progress = memoryview(shared_progress).cast("B").cast("q")
    threading.Thread(target=_answer_calls, args=(Pipe(queries),), daemon=True).start()
    _answer_calls(Pipe(calls))


def _answer_calls(pipe: Any) -> None:
    while True:
        try:
            number, name, args = read_call(pipe.receive())
        except (EOFError, OSError):
            return
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
