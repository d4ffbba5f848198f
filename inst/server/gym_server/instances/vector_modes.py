"""What is different about the vectorization modes of vector environments."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from gymnasium.spaces import Space
from gymnasium.vector import VectorEnv

from gym_server.envs.vector_envs import AsyncSubEnvs, SyncSubEnvs
from gym_server.envs.wrappers import draws_when_stepped
from gym_server.errors import GymServerError
from gym_server.rendering.render_thread import RenderThread
from gym_server.viewing.observation_summary import sub_env_of

# An environment that draws all its sub-environments at once may have no more than these.
_MOST_DRAWN_AT_ONCE = 16


class Mode(Protocol):
    """How sub-environments are run.

    Attributes:
        resets_each: whether each sub-environment takes a seed, and a reset, of its own.
        steps_some: whether some sub-environments can step while the others wait.
        draws_when_stepped: whether its steps must run on the render thread.
        draws_in_process: whether sub-environments draw in this process.
    """

    resets_each: bool
    steps_some: bool
    draws_when_stepped: bool
    draws_in_process: bool

    def step_some(self, which: np.ndarray, actions: Any) -> tuple:
        """Step some sub-environments."""

    def draw(self, sub_env: int) -> object:
        """Draw a sub-environment."""

    def observed(self, space: Space, sub_env: int, batch: object) -> object:
        """Return the last observation of a sub-environment.

        Args:
            space: of one sub-environment.
            sub_env: its number, from 0.
            batch: the observations of the last move.
        """

    def close(self) -> None:
        """Close the environment."""

    def kill(self) -> None:
        """Kill the processes that it runs in, if it has any."""


class EntryPointMode:
    """The environment's own implementation, which has one generator for all."""

    resets_each = False
    steps_some = False
    draws_when_stepped = False
    draws_in_process = True

    def __init__(self, env: VectorEnv, env_id: str, renderer: RenderThread) -> None:
        """Take over an environment."""
        self._env: Any = env
        self._env_id = env_id
        self._renderer = renderer

    def step_some(self, which: np.ndarray, actions: Any) -> tuple:
        """Refuse: it steps all of them."""
        raise NotImplementedError

    def draw(self, sub_env: int) -> object:
        """Draw all sub-environments, and return one of the frames."""
        if self._env.num_envs > _MOST_DRAWN_AT_ONCE:
            raise GymServerError(
                "cannot_render",
                f"{self._env_id} draws all of its {self._env.num_envs} sub-environments at once, "
                f"and the most that this server lets it draw are {_MOST_DRAWN_AT_ONCE}",
                "create the environment with vectorization_mode 'sync'",
            )
        return self._renderer.run(self._env.render)[sub_env]

    def observed(self, space: Space, sub_env: int, batch: object) -> object:
        """Return a row of the last batch."""
        return sub_env_of(space, batch, sub_env)

    def close(self) -> None:
        """Close the environment on the render thread."""
        self._renderer.run(self._env.close)

    def kill(self) -> None:
        """Do nothing: it runs in this process."""


class SyncMode:
    """Sub-environments one after the other in this process."""

    resets_each = True
    steps_some = True
    draws_in_process = True

    def __init__(self, env: SyncSubEnvs, env_id: str, renderer: RenderThread) -> None:
        """Take over an environment."""
        self._env = env
        self._renderer = renderer
        self.draws_when_stepped = draws_when_stepped(env.envs[0])

    def step_some(self, which: np.ndarray, actions: Any) -> tuple:
        """Step some sub-environments."""
        return self._env.step_sub_envs(which, actions)

    def draw(self, sub_env: int) -> object:
        """Draw a sub-environment on the render thread."""
        return self._renderer.run(self._env.render_sub_env, sub_env)

    def observed(self, space: Space, sub_env: int, batch: object) -> object:
        """Ask the sub-environments: the last batch may have held only some of them."""
        return self._env.observation_of(sub_env)

    def close(self) -> None:
        """Close the environment on the render thread."""
        self._renderer.run(self._env.close)

    def kill(self) -> None:
        """Do nothing: it runs in this process."""


class AsyncMode:
    """Sub-environments in a process each, where they also draw."""

    resets_each = True
    steps_some = False
    draws_when_stepped = False
    draws_in_process = False

    def __init__(self, env: AsyncSubEnvs, env_id: str, renderer: RenderThread) -> None:
        """Take over an environment."""
        self._env = env

    def step_some(self, which: np.ndarray, actions: Any) -> tuple:
        """Refuse: it steps all of them."""
        raise NotImplementedError

    def draw(self, sub_env: int) -> object:
        """Draw a sub-environment in its process."""
        return self._env.render_sub_env(sub_env)

    def observed(self, space: Space, sub_env: int, batch: object) -> object:
        """Return a row of the last batch."""
        return sub_env_of(space, batch, sub_env)

    def close(self) -> None:
        """Ask the processes to end."""
        self._env.close()

    def kill(self) -> None:
        """Kill the processes, which ends what hangs in them."""
        self._env.kill()


MODES: dict[str, Callable[[Any, str, RenderThread], Mode]] = {
    "vector_entry_point": EntryPointMode,
    "sync": SyncMode,
    "async": AsyncMode,
}
