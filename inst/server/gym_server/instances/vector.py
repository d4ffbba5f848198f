"""A vector environment: actions, observations and the rest have a row for each sub-environment."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from gymnasium.spaces import Dict, Space, Tuple
from gymnasium.vector import AutoresetMode

from gym_server import spaces
from gym_server.envs import argument_limits
from gym_server.envs.config import EnvConfig
from gym_server.envs.outcomes import checked_info
from gym_server.errors import GymServerError, invalid_parameter, wrong_length
from gym_server.instances.environment import env_id_of
from gym_server.instances.episode_statistics import Statistics, VectorEpisodeStatistics
from gym_server.json_values import plain
from gym_server.protocol.answers import AnswerForm
from gym_server.vector_envs.entry_point import EntryPointEnv
from gym_server.vector_envs.sub_envs import SubEnvs


class VectorEnvironment:
    """A vector environment; see ``Environment`` for the methods."""

    # Some sub-environments may have moved then, and others not.
    fails_as_a_whole = True

    def __init__(self, env: EntryPointEnv | SubEnvs, mode: str, config: EnvConfig) -> None:
        """Take over a vector environment.

        Args:
            env: the environment.
            mode: its vectorization_mode.
            config: what the client wanted.

        Raises:
            GymServerError: ``unsupported_space``.
        """
        self.gym_env: Any = env
        self.env_id = env_id_of(config, env)
        self._num_envs = env.num_envs
        self.action_space = env.action_space
        self.observation_space = env.observation_space
        self.single_action_space = env.single_action_space
        self.single_observation_space = env.single_observation_space
        if _has_empty_part(self.single_action_space):
            raise GymServerError(
                "unsupported_space",
                "Gymnasium cannot give each sub-environment its action where it is of "
                f"{spaces.brief_space(self.single_action_space)}",
                "an empty Tuple or Dict is the reason; create the environment without num_envs",
            )
        self.vectorization_mode: str | None = mode
        self.num_workers = env.num_workers
        self.autoreset_mode: str | None = env.autoreset_mode.value
        self.draws_when_stepped = env.draws_when_stepped
        self.drawing = env.drawing
        self.draws_on_render_thread = env.render_mode == "rgb_array" and env.draws_in_process
        self.statistics: Statistics = VectorEpisodeStatistics(env.num_envs, env.autoreset_mode)

    # Reset ----------------------------------------------------------------------------------

    def check_reset(
        self, seed: Any, options: dict | None, mask: np.ndarray | None, was_reset: bool
    ) -> None:
        """Raise ``invalid_parameter``, ``not_supported`` or ``reset_needed`` before a reset."""
        self._check_seed(seed)
        argument_limits.check_reset_options(self.gym_env, options)
        if options and "reset_mask" in options:
            raise GymServerError(
                "invalid_parameter",
                "The parameter 'options' must not carry 'reset_mask'",
                "reset_mask is a parameter of its own",
            )
        if mask is not None:
            self._check_reset_mask(mask, was_reset)

    def _check_seed(self, seed: int | tuple | None) -> None:
        if not isinstance(seed, tuple):
            return
        if len(seed) != self._num_envs:
            raise wrong_length("seed", len(seed), self._num_envs, "integer or null")
        if not self.gym_env.runs_each:
            raise self._not_supported("seed for each sub-environment")
        if self.gym_env.autoreset_mode is AutoresetMode.DISABLED:
            for one in seed:
                if isinstance(one, tuple):
                    raise invalid_parameter(
                        "seed",
                        list(one),
                        "an integer, 0 or greater, or null, for each sub-environment, as with "
                        "autoreset_mode 'Disabled' none begins an episode by itself",
                    )

    def _check_reset_mask(self, mask: np.ndarray, was_reset: bool) -> None:
        self._check_mask("reset_mask", mask)
        if not self.gym_env.runs_each:
            raise self._not_supported("reset_mask")
        if not was_reset:
            raise GymServerError(
                "reset_needed",
                "reset() with a mask needs sub-environments that have been reset",
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
            f"With vectorization_mode '{self.vectorization_mode}' there is no {what}",
            "create the environment with vectorization_mode 'sync'",
        )

    def reset(self, seed: Any, options: dict | None, mask: np.ndarray | None, infos: bool) -> tuple:
        """Reset all sub-environments, or those of a mask."""
        start: tuple = self.gym_env.reset(seed, options, mask, infos)
        return start

    def begin_episodes(self, mask: np.ndarray | None) -> None:
        """Leave it to the environment, which knows what has begun."""

    # Step -----------------------------------------------------------------------------------

    def select(self, mask: np.ndarray | None) -> tuple[np.ndarray | None, int]:
        """Return which sub-environments a mask selects, None for all, and how many they are."""
        if mask is None:
            return None, self._num_envs
        self._check_mask("step_mask", mask)
        if not self.gym_env.runs_each:
            raise self._not_supported("step_mask")
        which = np.flatnonzero(mask)
        return which, len(which)

    def check_running(self, which: np.ndarray | None) -> None:
        """Raise ``reset_needed`` when sub-environments ended that do not reset themselves."""
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

    def step(self, which: np.ndarray | None, action: Any, infos: bool) -> tuple:
        """Step all sub-environments, or some."""
        outcome: tuple = self.gym_env.step(which, action, infos)
        return outcome

    def read_outcome(
        self, which: np.ndarray | None, reward: Any, terminated: Any, truncated: Any
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return rewards, terminated, truncated and done as arrays."""
        terminated = np.asarray(terminated, dtype=bool)
        truncated = np.asarray(truncated, dtype=bool)
        reward = _reward(reward).reshape(terminated.shape)
        return reward, terminated, truncated, terminated | truncated

    def count(self, which: np.ndarray | None, reward: np.ndarray, done: np.ndarray) -> int:
        """Count a step of those that took part in it; return how many they are."""
        moved = self.gym_env.moved
        if moved is not None:
            which = np.flatnonzero(moved) if which is None else which[moved]
            reward, done = reward[moved], done[moved]
        self.statistics.step(reward, done, which)
        return len(reward)

    def answer(
        self,
        observation: object,
        reward: np.ndarray,
        terminated: np.ndarray,
        truncated: np.ndarray,
        done: np.ndarray,
        info: dict,
        form: AnswerForm,
    ) -> dict:
        """Return the answer to a step: arrays where ``Parts`` are wanted, else lists."""
        final = self._take_final(info, form) if info else {}
        answer = {
            "observation": self.encode(observation, form),
            "reward": reward,
            "terminated": terminated,
            "truncated": truncated,
            "info": plain(checked_info(info)) if form.infos else {},
            **final,
        }
        if isinstance(answer["observation"], spaces.Parts):
            return answer
        answer["done"] = done
        return {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in answer.items()
        }

    def _take_final(self, info: dict, form: AnswerForm) -> dict:
        """Take the last observations of the sub-environments that were reset out of an info."""
        if "final_obs" not in info:
            return {}
        final, which = info.pop("final_obs"), info.pop("_final_obs")
        if not form.finals:
            return {}
        rows = np.flatnonzero(which)
        batch = spaces.stack(self.single_observation_space, [final[row] for row in rows])
        return {
            "final_obs": self.encode(batch, form, "final_obs"),
            "final_sub_envs": rows.tolist(),
        }

    # Values ---------------------------------------------------------------------------------

    def encode(self, observation: Any, form: AnswerForm, name: str = "observation") -> object:
        """Return a batch of observations as JSON values or as ``Parts``."""
        if form.tensors and self._write_tensors:
            return self._write_tensors[name](observation, form.by_column)
        return self._write_json(observation)

    # Made once, and only for a space that LocalBackend has found to be supported.
    @cached_property
    def _write_json(self) -> Callable[[Any], object]:
        return spaces.batch_json_writer(self.single_observation_space)

    @cached_property
    def _write_tensors(self) -> dict[str, Callable[[Any, bool], spaces.Parts]]:
        space = self.single_observation_space
        names = ("observation", "final_obs") if spaces.travels_as_tensors(space) else ()
        return {name: spaces.batch_tensor_writer(space, name) for name in names}

    def encode_action(self, action: Any) -> object:
        """Return one action for each sub-environment as JSON values."""
        return spaces.encode_sub_envs(self.single_action_space, action)

    def decode(self, space: Space, value: object) -> object:
        """Return the members of a space in a list that has one for each sub-environment."""
        return spaces.decode_sub_envs(space, value, self._num_envs, "the sub-environments")

    @property
    def pids(self) -> Sequence[int]:
        """The processes that they run in."""
        return list(self.gym_env.pids)

    @property
    def has_ended(self) -> bool:
        """Whether an episode ended that only a reset of the client's follows."""
        return bool(self.gym_env.ended.any())

    def observed(self, sub_env: int, observation: Any) -> object:
        """Return the last observation of a sub-environment."""
        return self.gym_env.observed(sub_env, observation)

    def draw(self, sub_env: int) -> object:
        """Draw a sub-environment."""
        return self.gym_env.draw(sub_env)

    # The end --------------------------------------------------------------------------------

    def close(self) -> None:
        """Close all sub-environments."""
        self.gym_env.close()

    def report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        """From now on report when a process that they run in ends by itself, or if it has."""
        self.gym_env.report_end(on_end)

    def kill(self, why: GymServerError) -> None:
        """Kill the processes that they run in, if they have any."""
        self.gym_env.kill(why)


def _has_empty_part(space: Space) -> bool:
    """Tell whether a space is an empty Tuple or Dict, or has such a part."""
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
