"""A vector environment: actions, observations and rewards have a row per sub-environment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium.spaces import Dict, Space, Tuple
from gymnasium.vector import AutoresetMode

from gym_server import spaces
from gym_server.envs.config import EnvConfig
from gym_server.envs.make import call_env
from gym_server.envs.outcomes import checked_info
from gym_server.errors import GymServerError, invalid_parameter, reset_needed, wrong_length
from gym_server.instances.episode_statistics import VectorEpisodeStatistics
from gym_server.instances.instance import Instance
from gym_server.json_values import plain
from gym_server.protocol.answers import AnswerForm
from gym_server.rendering.render_thread import RenderThread
from gym_server.vector_envs.entry_point import EntryPointEnv, why_seed_too_large
from gym_server.vector_envs.sub_envs import SubEnvs


class VectorInstance(Instance):
    """A vector environment, whose sub-environments run in this process or in workers."""

    statistics: VectorEpisodeStatistics

    def __init__(
        self, env: EntryPointEnv | SubEnvs, mode: str, config: EnvConfig, renderer: RenderThread
    ) -> None:
        """Take over a vector environment.

        Args:
            env: the environment.
            mode: its vectorization_mode.
            config: what the client wanted.
            renderer: the process's render thread.

        Raises:
            GymServerError: ``unsupported_space``.
        """
        self.single_action_space = env.single_action_space
        self.single_observation_space = env.single_observation_space
        if _has_empty_part(self.single_action_space):
            raise GymServerError(
                "unsupported_space",
                "Gymnasium cannot split the actions of sub-environments with "
                f"{spaces.brief_space(self.single_action_space)}",
                "it has an empty Tuple or Dict; create the environment without num_envs",
            )
        super().__init__(env, config, renderer)
        self._num_envs = env.num_envs
        self.vectorization_mode = mode
        self.num_workers = env.num_workers
        self.autoreset_mode = env.autoreset_mode.value
        self.draws_when_stepped = env.draws_when_stepped
        self.drawing = env.drawing
        self.statistics = VectorEpisodeStatistics(env.num_envs, env.autoreset_mode)

    # Reset ----------------------------------------------------------------------------------

    def _check_reset(self, seed: Any, options: dict | None, mask: np.ndarray | None) -> None:
        self._check_seed(seed)
        if options and "reset_mask" in options:
            raise GymServerError(
                "invalid_parameter",
                "The parameter 'options' must not contain 'reset_mask'",
                "send reset_mask as its own parameter",
            )
        if mask is not None:
            self._check_reset_mask(mask)

    def _check_seed(self, seed: int | tuple | None) -> None:
        if isinstance(self.gym_env, EntryPointEnv):
            self._check_seed_of_entry_point(seed)
        if not isinstance(seed, tuple):
            return
        if len(seed) != self._num_envs:
            raise wrong_length("seed", len(seed), self._num_envs, "integer or null")
        if self.gym_env.autoreset_mode is AutoresetMode.DISABLED:
            for one in seed:
                if isinstance(one, tuple):
                    raise invalid_parameter(
                        "seed",
                        list(one),
                        "an integer, 0 or greater, or null, for each sub-environment, because with "
                        "autoreset_mode 'Disabled' none starts an episode automatically",
                    )

    def _check_seed_of_entry_point(self, seed: int | tuple | None) -> None:
        if not self.gym_env.resets_each:
            if isinstance(seed, tuple):
                raise self._not_supported("seed for each sub-environment")
            return
        if isinstance(seed, tuple) and any(isinstance(one, tuple) for one in seed):
            raise self._not_supported("seeds for the episodes that follow")
        reason = why_seed_too_large(seed, self._num_envs)
        if reason is not None:
            raise GymServerError("invalid_parameter", f"{self.env_id}: {reason}")

    def _check_reset_mask(self, mask: np.ndarray) -> None:
        self._check_mask("reset_mask", mask)
        if not self.gym_env.resets_each:
            raise self._not_supported("reset_mask")
        if not self.was_reset:
            raise GymServerError(
                "reset_needed",
                "reset() with a mask needs sub-environments that were reset before",
                "reset all of them first",
            )

    def _check_mask(self, name: str, mask: np.ndarray) -> None:
        if len(mask) != self._num_envs:
            raise wrong_length(name, len(mask), self._num_envs, "boolean")
        if not mask.any():
            raise GymServerError(
                "invalid_parameter",
                f"The parameter '{name}' must hold true for at least one sub-environment",
            )

    def _not_supported(self, what: str) -> GymServerError:
        return GymServerError(
            "not_supported",
            f"vectorization_mode '{self.vectorization_mode}' does not support {what}",
            "create the environment with vectorization_mode 'sync'",
        )

    def _reset_env(
        self, seed: Any, options: dict | None, mask: np.ndarray | None, form: AnswerForm
    ) -> tuple:
        start: tuple = self.gym_env.reset(seed, options, mask, form.infos)
        return start

    # Step -----------------------------------------------------------------------------------

    def _step(self, action: object, form: AnswerForm, mask: np.ndarray | None) -> dict:
        if not self.was_reset:
            raise reset_needed("step()")
        which = None if mask is None else self._select(mask)
        rows = None if which is None else len(which)
        decoded = self._actions.read(action, rows)
        self._check_running(which)
        try:
            return call_env(self._step_env, which, decoded, form)
        except GymServerError as failure:
            # Some sub-environments may have taken the step, and others not.
            self.was_reset = False
            self._actions.explain(failure, decoded, rows)
            raise

    def _select(self, mask: np.ndarray) -> np.ndarray:
        """Return the numbers of the sub-environments in a mask."""
        self._check_mask("step_mask", mask)
        if not self.gym_env.runs_each:
            raise self._not_supported("step_mask")
        return np.flatnonzero(mask)

    def _check_running(self, which: np.ndarray | None) -> None:
        """Raise ``reset_needed`` if sub-environments ended that are not reset automatically."""
        if self.gym_env.autoreset_mode is not AutoresetMode.DISABLED:
            return
        waiting = self.gym_env.ended
        ended = np.flatnonzero(waiting) if which is None else which[waiting[which]]
        if len(ended):
            raise GymServerError(
                "reset_needed",
                f"step() needs a running episode in every sub-environment, and "
                f"{_named(ended)} ended",
                "reset with a reset_mask, or step the others with a step_mask",
            )

    def _step_env(self, which: np.ndarray | None, action: object, form: AnswerForm) -> dict:
        """Take a step; return arrays if ``Parts`` are wanted, else lists."""
        outcome = self._begin(self.gym_env.step, which, action, form.infos)
        observation, reward, terminated, truncated, info = outcome
        terminated = np.asarray(terminated, dtype=bool)
        truncated = np.asarray(truncated, dtype=bool)
        reward = _reward(reward).reshape(terminated.shape)
        done = terminated | truncated
        self._count(which, reward, done)
        self._observation = observation
        final = self._take_final(info, form) if info else {}
        answer = {
            "observation": self._write(observation, form),
            "reward": reward,
            "terminated": terminated,
            "truncated": truncated,
            "info": plain(info) if form.infos and checked_info(info) else {},
            **final,
        }
        if isinstance(answer["observation"], spaces.Parts):
            return answer
        answer["done"] = done
        return {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in answer.items()
        }

    def _count(self, which: np.ndarray | None, reward: np.ndarray, done: np.ndarray) -> None:
        """Count a step of the sub-environments that took part in it."""
        stepped = self.gym_env.moved
        if stepped is not None:
            which = np.flatnonzero(stepped) if which is None else which[stepped]
            reward, done = reward[stepped], done[stepped]
        self.statistics.step(reward, done, which)
        self.steps += len(reward)

    def _take_final(self, info: dict, form: AnswerForm) -> dict:
        """Remove the last observations of sub-environments that were reset from an info."""
        if "final_obs" not in info:
            return {}
        final, which = info.pop("final_obs"), info.pop("_final_obs")
        if not form.finals:
            return {}
        rows = np.flatnonzero(which)
        batch = spaces.stack(self.single_observation_space, [final[row] for row in rows])
        return {
            "final_obs": self._write(batch, form, "final_obs"),
            "final_sub_envs": rows.tolist(),
        }

    # Values ---------------------------------------------------------------------------------

    def _sample_action(self) -> object:
        return spaces.encode_members(self.single_action_space, self.gym_env.action_space.sample())

    def _decode(self, space: Space, value: object) -> object:
        return spaces.decode_sub_envs(
            space, value, spaces.Rows(self._num_envs, "the sub-environments")
        )

    @property
    def has_ended(self) -> bool:
        """Whether an episode ended that only the client can reset."""
        return bool(self.gym_env.ended.any())

    def _observed(self, sub_env: int) -> object:
        return self.gym_env.observed(sub_env, self._observation)

    def draw(self, sub_env: int) -> object:
        """Draw a sub-environment."""
        return self.gym_env.draw(sub_env)

    # The end --------------------------------------------------------------------------------

    def _close_env(self) -> None:
        self.gym_env.close()

    def report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        """Report the end of a worker process; see ``Instance.report_end()``."""

        def end(why: GymServerError) -> None:
            self.viewer.end(why)
            on_end(why)

        self.gym_env.report_end(end)


def _has_empty_part(space: Space) -> bool:
    """Return whether a space is an empty Tuple or Dict, or contains one."""
    match space:
        case Dict() | Tuple():
            parts = space.spaces.values() if isinstance(space, Dict) else space.spaces
            return not parts or any(map(_has_empty_part, parts))
        case _:
            return False


def _named(sub_envs: np.ndarray, most: int = 10) -> str:
    """Return the numbers of some sub-environments as words."""
    if len(sub_envs) == 1:
        return f"sub-environment {sub_envs[0]}"
    more = f" and {len(sub_envs) - most} more" if len(sub_envs) > most else ""
    return f"sub-environments {', '.join(map(str, sub_envs[:most]))}{more}"


def _reward(reward: object) -> np.ndarray:
    array = np.asarray(reward)
    return array if array.dtype in (np.float32, np.float64) else array.astype(np.float64)
