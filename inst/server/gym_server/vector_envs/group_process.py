"""A group of sub-environments in a process of its own, and what that process runs.

What such a process runs would otherwise run in the server's own process. So the server trusts it
as it trusts itself, and both send Python's objects.
"""

from __future__ import annotations

import logging
import os
import pickle
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from typing import Any, cast

from gymnasium.vector import AutoresetMode

from gym_server.errors import GymServerError, answer_to, environment_error, shutting_down
from gym_server.processes import start
from gym_server.processes.messages import object_message, read_call, refusal_message
from gym_server.processes.pipe import Pipe
from gym_server.processes.set_up import set_up_process
from gym_server.processes.worker_process import WorkerProcess
from gym_server.vector_envs.group import Group
from gym_server.vector_envs.sub_env import SubEnv

# Its imports take longer than the start of a process.
start.preload(__name__)


# In the process -----------------------------------------------------------------------------


def serve_groups(calls: Connection, _: Connection, log_level: int) -> None:
    """Serve one group after the other, until the server closes the pipe or is gone."""
    set_up_process(log_level)
    pipe = Pipe(calls)
    methods = _Methods()
    while True:
        try:
            number, method, args = read_call(pipe.receive())
        except (EOFError, OSError):
            os._exit(0)
        message = _answer(number, getattr(methods, method), *args)
        try:
            pipe.send(message)
        except (OSError, ValueError):
            os._exit(1)


def _answer(number: int, call: Callable, *args: object) -> bytes:
    try:
        return object_message(number, call(*args))
    except GymServerError as refusal:
        return refusal_message(number, answer_to(refusal)[1])
    except BaseException as failure:
        return refusal_message(number, answer_to(environment_error(failure))[1])


class _Methods:
    """The methods that the server can call, by name."""

    _group: Group

    def make(self, pickled: bytes, numbers: Sequence[int], mode: AutoresetMode) -> None:
        # Pickled by itself: a call that cannot be read ends the process, and this is an error.
        sub_env: SubEnv = pickle.loads(pickled)
        sub_env.prepare()
        self._group = Group(sub_env, numbers, mode)

    def reset(self, *args: Any) -> object:
        return self._group.reset(*args)

    def step(self, *args: Any) -> object:
        return self._group.step(*args)

    def render(self, index: int) -> object:
        return self._group.render(index)

    def observed(self, index: int) -> object:
        return self._group.observed(index)

    def close(self) -> None:
        group = self._group
        del self._group
        group.close()


# In the server ------------------------------------------------------------------------------


class GroupProcess:
    """A process that runs a group; one after the other.

    Attributes:
        on_end: called with the reason when it ends without having been asked to.
    """

    def __init__(self) -> None:
        """Start it, without a group."""
        self.on_end: Callable[[GymServerError], None] = lambda why: None
        self._worker = WorkerProcess(
            serve_groups,
            logging.getLogger().level,
            on_end=lambda why: self.on_end(why),
            hint="",
            trusted=True,
        )

    @property
    def pid(self) -> int:
        """Its number."""
        return self._worker.pid

    @property
    def is_alive(self) -> bool:
        """Whether it has not ended."""
        return self._worker.why is None

    def begin_make(self, sub_env: SubEnv, numbers: Sequence[int], mode: AutoresetMode) -> None:
        """Let it make a group; ``finish()`` waits for it.

        Raises:
            GymServerError: for an environment that cannot be sent there.
        """
        try:
            pickled = pickle.dumps(sub_env, 5)
        except Exception as failure:
            raise GymServerError("not_supported", str(failure)) from failure
        self.begin("make", pickled, numbers, mode)

    def begin(self, method: str, *args: object) -> None:
        """Begin a call of one of its group's methods; ``finish()`` must follow.

        Raises:
            GymServerError: ``environment_died``, or why it was killed.
        """
        self._worker.begin(method, *args)

    def finish(self) -> Any:
        """Return the result of the call that has begun.

        Raises:
            GymServerError: what the group refused with, or as ``begin()``.
        """
        return cast(Any, self._worker.finish()).value

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
