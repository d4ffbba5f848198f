"""An environment for playing episodes one after another, in a process of the pool."""

from __future__ import annotations

import dataclasses
import platform
from functools import cached_property
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Space
from gymnasium.vector import VectorEnv

from gym_server import logs, spaces
from gym_server.envs import make, registry, wrappers
from gym_server.envs.drawing_on_demand import save_drawing
from gym_server.envs.extras import engine_versions
from gym_server.envs.quick_choice import choose_quickly
from gym_server.json_values import plain
from gym_server.rollouts.task import Task
from gym_server.vector_envs.make_vec import make_own_implementation
from gym_server.vector_envs.sub_env import ThisThread

# How many episodes an environment's own vector implementation plays in lockstep. The number is
# fixed, because all of them share one generator. R gets it from the description.
GROUP = 256

# Environments in which a later episode plays like the first one of a new environment: a test has
# compared the two in each of them. All others are made anew for each episode. Among these is
# BipedalWalker, because its world of Box2D keeps a state.
_KEPT = (
    "gymnasium.envs.classic_control",
    "gymnasium.envs.toy_text",
    "gymnasium.envs.box2d.lunar_lander",
    "gymnasium.envs.box2d.car_racing",
    "gymnasium.envs.mujoco",
    "gymnasium.envs.phys2d",
    "gymnasium.envs.tabular",
    "ale_py",
)

# Environments without a time limit whose episodes always end: an Atari game ends after half an
# hour, unless this argument changes that.
_ENDING = ("gymnasium.envs.toy_text.blackjack", "gymnasium.envs.tabular.blackjack", "ale_py")
_ATARI_LIMIT = "max_num_frames_per_episode"

# Wrappers that carry a state from one episode to the next.
_REMEMBERING = ("NormalizeObservation", "NormalizeReward")


class RolloutEnv:
    """Makes the environment of a task, and keeps it for further episodes if that is safe.

    Attributes:
        env: the environment, or the environment's own vector implementation for groups.
        group: how many episodes are played in lockstep; None if episodes are played separately.
        observation_space, action_space: the spaces of one episode.
    """

    def __init__(self, task: Task) -> None:
        """Make the environment.

        Raises:
            GymServerError: see ``make.make_env()`` and ``make_vector_env()``.
        """
        self._task = task
        with logs.hearing() as self._warnings:
            own = self._make_own()
            self.env: Any = self._make() if own is None else own
        self.group = None if own is None else GROUP
        prefix = "" if own is None else "single_"
        self.observation_space: Space = getattr(self.env, f"{prefix}observation_space")
        self.action_space: Space = getattr(self.env, f"{prefix}action_space")
        self._used = False

    def _make_own(self) -> VectorEnv | None:
        config = dataclasses.replace(self._task.config, num_envs=GROUP)
        own = make_own_implementation(config, self._task.allowed_modules, ThisThread())
        if own is not None:
            # Policies act within the space. This check takes a sixth of a step.
            own.unwrapped.action_space.contains = lambda action: True  # type: ignore
        return own

    def _make(self) -> gymnasium.Env:
        task, config = self._task, self._task.config
        env = make.make_env(config, task.allowed_modules)
        env = make.call_env(wrappers.wrap, env, config.wrappers, ThisThread())
        # Some environments do work for drawing in each step.
        save_drawing(env)
        choose_quickly(env)
        return env

    @cached_property
    def is_made_anew(self) -> bool:
        """Whether each episode needs a new environment."""
        return not registry.module_of(self.env.spec).startswith(_KEPT)

    def for_an_episode(self) -> Any:
        """Return an environment that plays like a new one."""
        if self._used and self.is_made_anew:
            self.env.close()
            self.env = self._make()
        self._used = True
        return self.env

    def close(self) -> None:
        """Close the environment."""
        self.env.close()

    # What is known of it --------------------------------------------------------------------

    @property
    def time_limit(self) -> int | None:
        """After how many steps the environment itself ends an episode, or None."""
        if self.group is not None:
            limit: int | None = self.env.spec.max_episode_steps
            return limit
        return wrappers.time_limit(self.env)

    @property
    def needs_max_steps(self) -> bool:
        """Whether an episode may never end."""
        ends = registry.module_of(self.env.spec).startswith(_ENDING)
        chosen = self._task.config.kwargs or {}
        return self.time_limit is None and (not ends or _ATARI_LIMIT in chosen)

    @property
    def remembers(self) -> list[str]:
        """The client's wrappers that carry a state from one episode to the next."""
        return [one.name for one in self._task.config.wrappers if one.name in _REMEMBERING]

    def describe(self) -> dict:
        """Return what a client must know to make a policy for the environment."""
        config, spec = self._task.config, self.env.spec
        metadata = self.env.metadata or {}
        env_id = make.env_id_of(config, self.env)
        return {
            "env_id": env_id,
            "observation_space": spaces.describe(self.observation_space),
            "action_space": spaces.describe(self.action_space),
            "spec": {
                "id": env_id,
                "kwargs": config.kwargs or {},
                "wrappers": [wrapper._asdict() for wrapper in config.wrappers],
                "max_episode_steps": self.time_limit,
                "reward_threshold": spec.reward_threshold if spec else None,
                "render_fps": plain(metadata.get("render_fps")),
                "engine": engine_versions(spec) if spec else {},
            },
            "warnings": self._warnings,
            "remembers": self.remembers,
            "needs_max_steps": self.needs_max_steps,
            "group": self.group,
            "versions": {"gymnasium": gymnasium.__version__, "numpy": np.__version__},
            "processor": platform.processor() or platform.machine(),
        }
