"""Vector environments with their own implementation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from gym_server.envs.drawing import Drawing
from gym_server.errors import GymServerError
from gym_server.rendering.render_thread import RenderThread
from gym_server.spaces.stacking import member_of

# The most sub-environments of an environment that draws all of them at once.
_MOST_DRAWN_AT_ONCE = 16


class EntryPointEnv:
    """An environment's own implementation, with one generator for all sub-environments.

    It has the attributes and methods of ``SubEnvs``.
    """

    runs_each = False
    draws_when_stepped = False
    draws_in_process = True
    num_workers = None
    moved = None
    pids = ()

    def __init__(self, env: VectorEnv, renderer: RenderThread) -> None:
        """Take over an environment.

        Args:
            env: the environment.
            renderer: the process's render thread.
        """
        self._env: Any = env
        self.drawing = Drawing(renderer)
        self.num_envs = env.num_envs
        self.autoreset_mode: AutoresetMode = env.metadata["autoreset_mode"]
        self.ended = np.zeros(env.num_envs, dtype=bool)
        self.metadata = env.metadata
        self.render_mode = env.render_mode
        self.spec = env.spec
        self.single_observation_space = env.single_observation_space
        self.single_action_space = env.single_action_space
        self.observation_space = env.observation_space
        self.action_space = env.action_space

    def reset(
        self, seed: int | None, options: dict | None, mask: None, with_infos: bool = True
    ) -> tuple[Any, dict]:
        """Start an episode in all sub-environments."""
        observation, info = self._env.reset(seed=seed, options=options)
        self.ended[:] = False
        return observation, info if with_infos else {}

    def step(self, which: None, actions: Any, with_infos: bool = True) -> tuple:
        """Step all sub-environments."""
        observation, reward, terminated, truncated, info = self._env.step(actions)
        if self.autoreset_mode is AutoresetMode.DISABLED:
            self.ended = np.asarray(terminated, dtype=bool) | np.asarray(truncated, dtype=bool)
        if not with_infos:
            info = {name: info[name] for name in ("final_obs", "_final_obs") if name in info}
        # The environment may change its arrays in the next step, before these are sent.
        results = [np.array(result) for result in (reward, terminated, truncated)]
        return observation, *results, info

    def draw(self, sub_env: int) -> object:
        """Draw all sub-environments, and return the frame of one."""
        if self.num_envs > _MOST_DRAWN_AT_ONCE:
            raise GymServerError(
                "cannot_render",
                f"{self.spec.id if self.spec else 'This environment'} draws all of its "
                f"{self.num_envs} sub-environments at once, and this server allows at most "
                f"{_MOST_DRAWN_AT_ONCE} for that",
                "create the environment with vectorization_mode 'sync'",
            )
        frames: Any = self.drawing.draw(self._env.render)
        return frames[sub_env]

    def observed(self, sub_env: int, batch: object) -> object:
        """Return the last observation of a sub-environment, given the last batch."""
        return member_of(self.single_observation_space, batch, sub_env)

    def report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        """Do nothing: this process does not end by itself."""

    def close(self) -> None:
        """Close the environment."""
        self.drawing.close(self._env.close)

    def kill(self, why: GymServerError | None = None) -> None:
        """Do nothing: it runs in this process."""
