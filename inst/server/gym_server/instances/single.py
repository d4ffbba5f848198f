"""A single environment: one action, one observation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium
from gymnasium.spaces import Space

from gym_server import spaces
from gym_server.envs.config import EnvConfig
from gym_server.envs.drawing import Drawing
from gym_server.envs.make import call_env
from gym_server.envs.outcomes import checked_info, reward_number
from gym_server.envs.wrappers import draws_when_stepped
from gym_server.errors import GymServerError, invalid_parameter, reset_needed
from gym_server.instances.episode_statistics import EpisodeStatistics
from gym_server.instances.instance import Instance
from gym_server.json_values import plain
from gym_server.protocol.answers import AnswerForm
from gym_server.rendering.render_thread import RenderThread

if TYPE_CHECKING:
    import numpy as np


class SingleInstance(Instance):
    """A single environment in this process."""

    has_ended = False
    statistics: EpisodeStatistics

    def __init__(self, env: gymnasium.Env, config: EnvConfig, renderer: RenderThread) -> None:
        """Take over an environment; see ``Instance``."""
        self.single_action_space = env.action_space
        self.single_observation_space = env.observation_space
        super().__init__(env, config, renderer)
        self.draws_when_stepped = draws_when_stepped(env)
        self.drawing = Drawing(renderer, self.draws_when_stepped)
        self.statistics = EpisodeStatistics()

    def _check_reset(self, seed: object, options: dict | None, mask: np.ndarray | None) -> None:
        _refuse_mask("reset_mask", mask)
        if isinstance(seed, tuple):
            raise invalid_parameter("seed", seed, "an integer, 0 or greater")

    def _reset_env(
        self, seed: Any, options: dict | None, mask: np.ndarray | None, form: AnswerForm
    ) -> tuple:
        start: tuple = (self.monitor or self.gym_env).reset(seed=seed, options=options)
        self.has_ended = False
        return start

    def _step(self, action: object, form: AnswerForm, mask: np.ndarray | None) -> dict:
        _refuse_mask("step_mask", mask)
        if not self.was_reset:
            raise reset_needed("step()")
        decoded = self._actions.read(action)
        try:
            return call_env(self._step_env, decoded, form)
        except GymServerError as failure:
            self._actions.explain(failure, decoded)
            raise

    def _step_env(self, action: object, form: AnswerForm) -> dict:
        outcome = self._begin((self.monitor or self.gym_env).step, action)
        observation, reward, terminated, truncated, info = outcome
        terminated, truncated = bool(terminated), bool(truncated)
        self.has_ended = done = terminated or truncated
        reward = reward_number(reward)
        self.statistics.step(reward, done)
        self.steps += 1
        self._observation = observation
        return {
            "observation": self._write(observation, form),
            "reward": reward,
            "done": done,
            "terminated": terminated,
            "truncated": truncated,
            # Convert it now, before the environment can change it.
            "info": plain(info) if form.infos and checked_info(info) else {},
        }

    def _sample_action(self) -> object:
        return spaces.encode(self.single_action_space, self.single_action_space.sample())

    def _decode(self, space: Space, value: object) -> object:
        return spaces.decode(space, value)

    def _observed(self, sub_env: int) -> object:
        return self._observation

    def draw(self, sub_env: int) -> object:
        """Draw the environment on the render thread."""
        return self.drawing.draw(self.gym_env.render)

    def _close_env(self) -> None:
        self.drawing.close(self.gym_env.close)


def _refuse_mask(name: str, mask: np.ndarray | None) -> None:
    if mask is not None:
        raise GymServerError(
            "not_supported",
            f"'{name}' is for environments with sub-environments",
            "create it with num_envs",
        )
