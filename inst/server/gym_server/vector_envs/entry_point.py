"""Vector environments with their own implementation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, VectorEnv

from gym_server.envs.drawing import Drawing
from gym_server.envs.registry import module_of
from gym_server.errors import GymServerError
from gym_server.rendering.render_thread import RenderThread
from gym_server.spaces.stacking import unstack

# The most sub-environments of an environment that draws all of them at once.
_MOST_DRAWN_AT_ONCE = 16

# Atari's seeds are C++'s int; -1 stands for none.
_LARGEST_SEED = 2**31 - 1
_NO_SEED = -1


def resets_each(spec: EnvSpec | None) -> bool:
    """Return whether an implementation resets some sub-environments, each with its own seed."""
    return spec is not None and module_of(spec).startswith("ale_py")


def why_seed_too_large(seed: Any, num_envs: int) -> str | None:
    """Return why such an implementation refuses a seed, or a tuple of one each; None if not."""
    largest = (
        seed + num_envs - 1 if isinstance(seed, int) else max(filter(None, seed or ()), default=0)
    )
    return None if largest <= _LARGEST_SEED else f"its seeds must be below {_LARGEST_SEED + 1}"


class EntryPointEnv:
    """An environment's own implementation, mostly with one generator for all sub-environments.

    It has the attributes and methods of ``SubEnvs``.
    """

    runs_each = False
    draws_when_stepped = False
    num_workers = None
    moved = None

    def __init__(self, env: VectorEnv, renderer: RenderThread) -> None:
        """Take over an environment.

        Args:
            env: the environment.
            renderer: the process's render thread.
        """
        self._env: Any = env
        self.drawing = Drawing(renderer)
        self.num_envs = env.num_envs
        self.resets_each = resets_each(env.spec)
        self.autoreset_mode: AutoresetMode = env.metadata["autoreset_mode"]
        self.ended = np.zeros(env.num_envs, dtype=bool)
        # In mode NEXT_STEP: those whose next step starts an episode.
        self._starting = np.zeros(env.num_envs, dtype=bool)
        self.metadata = env.metadata
        self.render_mode = env.render_mode
        self.spec = env.spec
        self.single_observation_space = env.single_observation_space
        self.single_action_space = env.single_action_space
        self.observation_space = env.observation_space
        self.action_space = env.action_space

    def reset(
        self,
        seed: int | tuple[int | None, ...] | None,
        options: dict | None,
        mask: np.ndarray | None,
        with_infos: bool = True,
    ) -> tuple[Any, dict]:
        """Start an episode in all sub-environments, or in those of a mask."""
        which = slice(None) if mask is None else mask
        if mask is not None:
            options = {**(options or {}), "reset_mask": mask}
            seed = (
                tuple(seed + at for at in range(self.num_envs)) if isinstance(seed, int) else seed
            )
        own: Any = seed
        if isinstance(seed, tuple):
            own = np.array([_NO_SEED if one is None else one for one in seed])[which]
        base = self._env.unwrapped
        if hasattr(base, "prev_done"):
            # Gymnasium's JAX implementation keeps it, and would start these episodes once more.
            base.prev_done = np.zeros(self.num_envs, dtype=bool)
        observation, info = self._env.reset(seed=own, options=options)
        self.ended[which] = self._starting[which] = False
        return observation, info if with_infos else {}

    def step(self, which: None, actions: Any, with_infos: bool = True) -> tuple:
        """Step all sub-environments."""
        observation, *results, info = self._env.step(actions)
        # The environment may change its arrays in the next step, before these are sent.
        reward, terminated, truncated = (np.array(result) for result in results)
        done = terminated.astype(bool) | truncated.astype(bool)
        if self.autoreset_mode is AutoresetMode.DISABLED:
            self.ended = done
        elif self.autoreset_mode is AutoresetMode.NEXT_STEP:
            # Gymnasium's JAX implementation pays for this step.
            reward[self._starting] = 0
            self._starting = done
        if "final_obs" in info:
            # Atari's sends no mask.
            info.setdefault("_final_obs", done)
        if not with_infos:
            info = {name: info[name] for name in ("final_obs", "_final_obs") if name in info}
        return observation, reward, terminated, truncated, info

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
        return unstack(self.single_observation_space, batch)[sub_env]

    def report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        """Do nothing: this process does not end by itself."""

    def close(self) -> None:
        """Close the environment."""
        self.drawing.close(self._env.close)
