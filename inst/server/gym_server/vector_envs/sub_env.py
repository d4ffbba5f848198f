"""What makes sub-environments: in this process, or after a journey in another one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import gymnasium
from gymnasium.envs.registration import EnvSpec

from gym_server.envs.config import Wrapper
from gym_server.envs.make import load_creator, make_from_spec
from gym_server.envs.memory_reservation import MemoryReservation
from gym_server.envs.wrappers import wrap
from gym_server.rendering.render_thread import RenderThread
from gym_server.vector_envs.copies import can_copy, copy_new


class SubEnv:
    """Makes sub-environments, each an environment and the wrappers around it."""

    def __init__(
        self,
        spec: EnvSpec,
        render_mode: str | None,
        kwargs: dict,
        wrappers: Sequence[Wrapper],
        renderer: RenderThread,
        memory: MemoryReservation,
    ) -> None:
        """Keep the arguments; each call makes one.

        Args:
            spec: of the environment.
            render_mode: handed to it, or None.
            kwargs: handed to it.
            wrappers: see ``wrappers.wrap()``.
            renderer: where wrappers that draw are made.
            memory: reserves the memory of the wrappers for all sub-environments when the first one
                is made.
        """
        self._make_args = spec, render_mode, kwargs
        self._wrappers = wrappers
        self._renderer: Any = renderer
        self._memory: MemoryReservation | None = memory

    def __getstate__(self) -> dict:
        """Leave out the render thread and the reservation, which stay in the server's process."""
        return {**self.__dict__, "_renderer": ThisThread(), "_memory": None}

    def prepare(self) -> None:
        """Import what makes it; once in each process, before the first one is made."""
        load_creator(self._make_args[0])

    def __call__(self) -> gymnasium.Env:
        """Make another one."""
        memory, self._memory = self._memory, None
        return wrap(make_from_spec(*self._make_args), self._wrappers, self._renderer, memory)

    def make_all(self, count: int) -> Iterator[gymnasium.Env]:
        """Make some, one after the other; none may be played or drawn before the last is made."""
        first = self()
        yield first
        # The client's wrappers may hold what they change in place, such as queues.
        copies = not self._wrappers and can_copy(first)
        for _ in range(count - 1):
            yield copy_new(first) if copies else self()


class ThisThread:
    """Stands for the render thread in a process with a single thread.

    It has the one method that wrappers call.
    """

    def run(self, draw: Callable, *args: object) -> Any:
        """Call a function."""
        return draw(*args)
