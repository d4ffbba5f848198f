"""A single environment: one action, one observation."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any

import gymnasium
from gymnasium.spaces import Space

from gym_server import spaces
from gym_server.envs import argument_limits
from gym_server.envs.config import EnvConfig
from gym_server.envs.drawing import Drawing
from gym_server.envs.outcomes import checked_info, reward_number
from gym_server.envs.wrappers import draws_when_stepped
from gym_server.errors import GymServerError
from gym_server.instances.environment import env_id_of
from gym_server.instances.episode_statistics import EpisodeStatistics, Statistics
from gym_server.json_values import plain
from gym_server.protocol.answers import AnswerForm
from gym_server.rendering.render_thread import RenderThread

if TYPE_CHECKING:
    import numpy as np


class SingleEnvironment:
    """A single environment; see ``Environment`` for the methods."""

    vectorization_mode: str | None = None
    num_workers: int | None = None
    autoreset_mode: str | None = None
    fails_as_a_whole = False
    pids = ()

    def __init__(self, env: gymnasium.Env, config: EnvConfig, renderer: RenderThread) -> None:
        """Take over an environment."""
        self.gym_env: Any = env
        self.env_id = env_id_of(config, env)
        self.action_space = self.single_action_space = env.action_space
        self.observation_space = self.single_observation_space = env.observation_space
        self.draws_when_stepped = draws_when_stepped(env)
        self.draws_on_render_thread = env.render_mode == "rgb_array"
        self.drawing = Drawing(renderer, self.draws_when_stepped)
        self.statistics: Statistics = EpisodeStatistics()
        self.has_ended = False

    def check_reset(
        self, seed: object, options: dict | None, mask: np.ndarray | None, was_reset: bool
    ) -> None:
        """Refuse options that make a loop."""
        argument_limits.check_reset_options(self.gym_env, options)

    def reset(self, seed: Any, options: dict | None, mask: np.ndarray | None, infos: bool) -> tuple:
        """Reset the environment."""
        start: tuple = self.gym_env.reset(seed=seed, options=options)
        return start

    def begin_episodes(self, mask: np.ndarray | None) -> None:
        """Remember that an episode has begun."""
        self.has_ended = False

    def select(self, mask: np.ndarray | None) -> tuple[None, None]:
        """Return that the environment takes one action; a mask was refused before."""
        return None, None

    def check_running(self, which: np.ndarray | None) -> None:
        """Leave it to the environment what comes after an episode's end."""

    def step(self, which: np.ndarray | None, action: Any, infos: bool) -> tuple:
        """Step the environment, which makes its info in any case."""
        outcome: tuple = self.gym_env.step(action)
        return outcome

    def read_outcome(
        self, which: np.ndarray | None, reward: Any, terminated: Any, truncated: Any
    ) -> tuple[float, bool, bool, bool]:
        """Return reward, terminated, truncated and done; remember the last."""
        terminated, truncated = bool(terminated), bool(truncated)
        self.has_ended = done = terminated or truncated
        return reward_number(reward), terminated, truncated, done

    def count(self, which: np.ndarray | None, reward: float, done: bool) -> int:
        """Count a step, and return 1."""
        self.statistics.step(reward, done, None)
        return 1

    def answer(
        self,
        observation: object,
        reward: float,
        terminated: bool,
        truncated: bool,
        done: bool,
        info: dict,
        form: AnswerForm,
    ) -> dict:
        """Return the answer to a step."""
        return {
            "observation": self.encode(observation, form),
            "reward": reward,
            "done": done,
            "terminated": terminated,
            "truncated": truncated,
            # Converted while the environment cannot change it.
            "info": plain(checked_info(info)) if form.infos else {},
        }

    def encode(self, observation: Any, form: AnswerForm) -> object:
        """Return an observation as a JSON value or as ``Parts``."""
        if form.tensors and self._write_tensors is not None:
            return self._write_tensors(observation, form.by_column)
        return self._write_json(observation)

    # Made once, and only for a space that LocalBackend has found to be supported.
    @cached_property
    def _write_json(self) -> Callable[[Any], object]:
        return spaces.json_writer(self.observation_space)

    @cached_property
    def _write_tensors(self) -> Callable[[Any, bool], spaces.Parts] | None:
        space = self.observation_space
        travels = spaces.travels_as_tensors(space)
        return spaces.tensor_writer(space, "observation") if travels else None

    def encode_action(self, action: Any) -> object:
        """Return an action as a JSON value."""
        return spaces.encode(self.action_space, action)

    def decode(self, space: Space, value: object) -> object:
        """Return the member of a space that a JSON value stands for."""
        return spaces.decode(space, value)

    def observed(self, sub_env: int, observation: Any) -> object:
        """Return the last observation."""
        return observation

    def draw(self, sub_env: int) -> object:
        """Draw the environment on the render thread."""
        return self.drawing.draw(self.gym_env.render)

    def close(self) -> None:
        """Close the environment."""
        self.drawing.close(self.gym_env.close)

    def report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        """Do nothing: this process does not end by itself."""

    def kill(self, why: GymServerError) -> None:
        """Do nothing: it runs in this process."""
