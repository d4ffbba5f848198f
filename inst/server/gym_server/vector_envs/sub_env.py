"""Make sub-environments, in this process or after being sent to another one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import gymnasium
from gymnasium.envs.registration import EnvSpec

from gym_server.envs.config import Wrapper
from gym_server.envs.make import load_creator, make_from_spec
from gym_server.envs.wrappers import wrap
from gym_server.rendering.render_thread import RenderThread
from gym_server.vector_envs.copies import can_copy, copy_new


class SubEnv:
    """Makes sub-environments: environments with their wrappers."""

    def __init__(
        self,
        spec: EnvSpec,
        render_mode: str | None,
        kwargs: dict,
        wrappers: Sequence[Wrapper],
        renderer: RenderThread,
    ) -> None:
        """Keep the arguments; each call makes a sub-environment.

        Args:
            spec: the environment's spec.
            render_mode: its render mode, or None.
            kwargs: its arguments.
            wrappers: see ``wrappers.wrap()``.
            renderer: the render thread for making wrappers that draw.
        """
        self._make_args = spec, render_mode, kwargs
        self._wrappers = wrappers
        self._renderer: Any = renderer

    def __getstate__(self) -> dict:
        """Leave out the render thread, which stays in the server's process."""
        return {**self.__dict__, "_renderer": ThisThread()}

    def prepare(self) -> None:
        """Import the environment's class; call once per process, before making any."""
        load_creator(self._make_args[0])

    def __call__(self) -> gymnasium.Env:
        """Make a sub-environment."""
        return wrap(make_from_spec(*self._make_args), self._wrappers, self._renderer)

    def make_all(self, count: int) -> Iterator[gymnasium.Env]:
        """Make several, one by one; none may be played or drawn before the last one is made."""
        first = self()
        yield first
        # The client's wrappers may keep objects that they change in place, such as queues.
        copies = not self._wrappers and can_copy(first)
        for _ in range(count - 1):
            yield copy_new(first) if copies else self()


class ThisThread:
    """Replaces the render thread in a process with a single thread.

    It has the only method that wrappers call.
    """

    def run(self, draw: Callable, *args: object) -> Any:
        """Call a function."""
        return draw(*args)
