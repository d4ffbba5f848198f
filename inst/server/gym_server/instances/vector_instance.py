"""An environment of many sub-environments: one row a sub-environment in what comes and goes."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from gymnasium.spaces import Dict, Space, Tuple
from gymnasium.vector import AutoresetMode, VectorEnv

from gym_server import spaces
from gym_server.envs import argument_limits
from gym_server.envs.config import EnvConfig
from gym_server.envs.make import ask
from gym_server.envs.vector_envs import AsyncSubEnvs, SyncSubEnvs
from gym_server.envs.wrappers import draws_when_stepped
from gym_server.errors import GymServerError, reset_needed, wrong_length
from gym_server.instances.episode_statistics import SubEnvTally
from gym_server.instances.instance import Instance
from gym_server.json_values import plain
from gym_server.rendering.render_thread import RenderThread
from gym_server.viewing.observation_summary import sub_env_of

# What draws all sub-environments at once may have no more than these.
_MOST_DRAWN_AT_ONCE = 16


class VectorInstance(Instance):
    """A vector environment; see ``Instance`` for what is the same."""

    _env: VectorEnv
    _tally: SubEnvTally

    def __init__(
        self, env: VectorEnv, mode: str, choices: EnvConfig, renderer: RenderThread
    ) -> None:
        """Take over a vector environment.

        Args:
            env: it.
            mode: its vectorization_mode.
            choices: what the client wanted.
            renderer: the process's render thread.

        Raises:
            GymServerError: ``unsupported_space``.
        """
        self._mode = mode
        self._autoreset_mode = env.metadata["autoreset_mode"]
        self._sub_envs = self._num_envs = env.num_envs
        # The sub-environments that ended, where nobody resets them.
        self._ended = np.zeros(env.num_envs, dtype=bool)
        super().__init__(env, choices, renderer)

    def _learn_spaces(self) -> None:
        self.action_space = self._env.action_space
        self.observation_space = self._env.observation_space
        self._sub_env_action_space = self._env.single_action_space
        self._sub_env_observation_space = self._env.single_observation_space
        if _holds_nothing(self._sub_env_action_space):
            raise GymServerError(
                "unsupported_space",
                "Gymnasium cannot give each sub-environment its action where it is of "
                f"{spaces.brief_space(self._sub_env_action_space)}",
                "an empty Tuple or Dict is the reason; create the environment without num_envs",
            )

    def _find_out_whether_it_draws(self) -> bool:
        return isinstance(self._env, SyncSubEnvs) and draws_when_stepped(self._env.envs[0])

    def _make_tally(self) -> SubEnvTally:
        return SubEnvTally(self._sub_envs, self._autoreset_mode)

    @cached_property
    def action_space_info(self) -> dict:
        """The description of the batched action space; it may be large."""
        return spaces.describe(self.action_space)

    @cached_property
    def observation_space_info(self) -> dict:
        """The description of the batched observation space; it may be large."""
        return spaces.describe(self.observation_space)

    # Reset ----------------------------------------------------------------------------------

    def reset(
        self,
        seed: int | tuple[int | None, ...] | None,
        options: dict | None,
        tensors: bool = False,
        mask: np.ndarray | None = None,
    ) -> dict:
        """Start an episode in every sub-environment, or in those of a mask.

        Args:
            seed: one for all sub-environments, each of which makes its own of it, or one a
                sub-environment; None as for a single environment.
            options: the environment's own.
            tensors: whether the observation is wanted as tensors.
            mask: a boolean a sub-environment; None for all of them.

        Returns:
            As for a single environment, with the observations of all sub-environments as a batch.

        Raises:
            GymServerError: ``invalid_parameter``, ``not_supported``, ``reset_needed`` (a mask
                before the first reset); ``environment_error``.
        """
        if self._for_eyes:
            self.screen.pace()
        with self.hold:
            self._check_seed(seed)
            self._check_options(options)
            if mask is not None:
                self._check_reset_mask(mask)
                options = {**(options or {}), "reset_mask": mask}
            seed_to_use = self._seed_for_reset if seed is None else seed
            if isinstance(seed_to_use, tuple):
                seed_to_use = list(seed_to_use)
            self._was_reset = False
            observation, info = ask(self._move, self._reset, seed_to_use, options)
            self._was_reset = True
            if seed is None:
                self._seed_for_reset = None
            elif mask is None:
                # One generator serves all sub-environments.
                self._seed_actions(seed)
            self._ended[slice(None) if mask is None else mask] = False
            self._tally.begin(mask)
            self._observation = observation
            return {
                "observation": ask(self._encode, observation, tensors),
                "info": ask(plain, info) if info else {},
            }

    def _reset(self, seed: int | list | None, options: dict | None) -> tuple:
        return self._env.reset(seed=seed, options=options)

    def _check_seed(self, seed: int | tuple | None) -> None:
        if not isinstance(seed, tuple):
            return
        if len(seed) != self._sub_envs:
            raise wrong_length("seed", len(seed), self._sub_envs, "integer or null")
        if self._mode == "vector_entry_point":
            raise self._not_supported("one seed a sub-environment")

    def _check_options(self, options: dict | None) -> None:
        argument_limits.check_reset_options(self._env, options)
        if options and "reset_mask" in options:
            raise GymServerError(
                "invalid_parameter",
                "The parameter 'options' must not carry 'reset_mask'",
                "reset_mask is a parameter of its own",
            )

    def _check_reset_mask(self, mask: np.ndarray) -> None:
        self._check_mask("reset_mask", mask)
        if self._mode == "vector_entry_point":
            raise self._not_supported("reset_mask")
        if not self._was_reset:
            raise GymServerError(
                "reset_needed",
                "reset() with a mask needs sub-environments that have been reset",
                "reset all of them first",
            )

    def _check_mask(self, name: str, mask: np.ndarray) -> None:
        if len(mask) != self._sub_envs:
            raise wrong_length(name, len(mask), self._sub_envs, "boolean")
        if not mask.any():
            raise GymServerError(
                "invalid_parameter",
                f"The parameter '{name}' must hold true for at least one sub-environment",
            )

    def _not_supported(self, what: str) -> GymServerError:
        return GymServerError(
            "not_supported",
            f"With vectorization_mode '{self._mode}' there is no {what}",
            "create the environment with vectorization_mode 'sync'",
        )

    # Step -----------------------------------------------------------------------------------

    def step(
        self,
        action: object,
        tensors: bool = False,
        mask: np.ndarray | None = None,
        for_eyes: bool = False,
    ) -> dict:
        """Take one step in every sub-environment, or in those of a mask.

        Args:
            action: a list of one JSON value for each sub-environment that steps, or a batch as
                ``Parts``.
            tensors: whether the answer is wanted as tensors.
            mask: a boolean a sub-environment; None for all of them.
            for_eyes: as for a single environment.

        Returns:
            As for a single environment, with one row for each sub-environment that stepped: arrays
            where the observation is ``Parts``, else lists.  When sub-environments ended and were
            reset at once also ``final_obs``, a batch of their last observations, and
            ``final_sub_envs``, the rows that they are.

        Raises:
            GymServerError: as for a single environment, each before any sub-environment moves;
                ``reset_needed`` also for a sub-environment that ended and is not reset by itself;
                ``invalid_parameter``, ``not_supported``.
        """
        if for_eyes or self._for_eyes:
            self.screen.pace()
        with self.hold:
            if not self._was_reset:
                raise reset_needed("step()")
            sub_envs = None if mask is None else self._sub_envs_of(mask)
            rows = self._sub_envs if sub_envs is None else len(sub_envs)
            batch = self._actions.read(action, rows)
            if self._autoreset_mode is AutoresetMode.DISABLED:
                self._refuse_ended(sub_envs)
            try:
                result = ask(
                    self._step_sub_envs, batch, sub_envs, tensors and self._observes_tensors
                )
            except GymServerError as failure:
                # Some sub-environments may have moved, and others not.
                self._was_reset = False
                self._actions.explain(failure, action, rows)
                raise
            self._steps += rows
            return result

    def _sub_envs_of(self, mask: np.ndarray) -> np.ndarray:
        self._check_mask("step_mask", mask)
        if not isinstance(self._env, SyncSubEnvs):
            raise self._not_supported("step_mask")
        return np.flatnonzero(mask)

    def _refuse_ended(self, sub_envs: np.ndarray | None) -> None:
        stepping = np.arange(self._sub_envs) if sub_envs is None else sub_envs
        ended = stepping[self._ended[stepping]]
        if len(ended):
            raise GymServerError(
                "reset_needed",
                f"step() needs a running episode in every sub-environment, and "
                f"{_named(ended)} ended",
                "reset with a reset_mask, or step the others with a step_mask",
            )

    def _step_sub_envs(self, batch: object, sub_envs: np.ndarray | None, tensors: bool) -> dict:
        if sub_envs is None:
            moved = self._move(self._env.step, batch)
        else:
            moved = self._move(self._env.step_sub_envs, sub_envs, batch)
        observation, reward, terminated, truncated, info = moved
        reward = _reward(reward)
        self._tally.step(reward, terminated | truncated, sub_envs)
        self._observation = observation
        if self._autoreset_mode is AutoresetMode.DISABLED:
            self._ended[slice(None) if sub_envs is None else sub_envs] = terminated | truncated
        final = self._take_final(info, tensors) if info else {}
        result = {
            "observation": self._encode(observation, tensors),
            "reward": reward,
            "terminated": np.asarray(terminated, dtype=bool),
            "truncated": np.asarray(truncated, dtype=bool),
            "info": plain(info) if info else {},
            **final,
        }
        return result if tensors else _as_lists(result)

    def _take_final(self, info: dict, tensors: bool) -> dict:
        """Take the last observations of the sub-environments that were reset out of an info."""
        if self._autoreset_mode is not AutoresetMode.SAME_STEP or "final_obs" not in info:
            return {}
        final, which = info.pop("final_obs"), info.pop("_final_obs")
        rows = np.flatnonzero(which)
        batch = spaces.stack(self._sub_env_observation_space, [final[row] for row in rows])
        return {
            "final_obs": self._encode(batch, tensors, "final_obs"),
            "final_sub_envs": rows.tolist(),
        }

    def _encode(self, batch: object, tensors: bool, name: str = "observation") -> object:
        if tensors and self._observes_tensors:
            return spaces.encode_batch_tensors(self._sub_env_observation_space, name, batch)
        return spaces.encode_batch(self._sub_env_observation_space, batch)

    # The rest -------------------------------------------------------------------------------

    def sample_action(self) -> object:
        """Draw an action for each sub-environment from the batched action space's own generator."""
        with self.hold:
            return spaces.encode_sub_envs(self._sub_env_action_space, self.action_space.sample())

    def action_contains(self, claim: dict) -> bool:
        """Answer a client's "contains": a value has one entry a sub-environment."""
        return self._contains(self._sub_env_action_space, "action_space_info", claim)

    def observation_contains(self, claim: dict) -> bool:
        """Answer a client's "contains": a value has one entry a sub-environment."""
        return self._contains(self._sub_env_observation_space, "observation_space_info", claim)

    def _contains(self, space: Any, info: str, claim: dict) -> bool:
        if "value" not in claim:
            return spaces.describes(claim, getattr(self, info))
        try:
            spaces.decode_sub_envs(space, claim["value"], self._sub_envs, "the sub-environments")
        except spaces.NotInSpace:
            return False
        return True

    def draws_on_render_thread(self) -> bool:
        """Tell whether a picture takes the render thread; async sub-environments draw in theirs."""
        return super().draws_on_render_thread() and not isinstance(self._env, AsyncSubEnvs)

    def _draw(self, sub_env: int) -> object:
        if isinstance(self._env, AsyncSubEnvs):
            return self._env.render_sub_env(sub_env)
        if isinstance(self._env, SyncSubEnvs):
            return self.renderer.run(self._env.render_sub_env, sub_env)
        if self._sub_envs > _MOST_DRAWN_AT_ONCE:
            raise GymServerError(
                "cannot_render",
                f"{self.env_id} draws all of its {self._sub_envs} sub-environments at once, and "
                f"the most that this server lets it draw are {_MOST_DRAWN_AT_ONCE}",
                "create the environment with vectorization_mode 'sync'",
            )
        return self.renderer.run(self._env.render)[sub_env]

    def _observed(self, sub_env: int) -> object:
        if isinstance(self._env, SyncSubEnvs):
            # The last batch may have held only some of the sub-environments.
            return self._env.observation_of(sub_env)
        return sub_env_of(self._sub_env_observation_space, self._observation, sub_env)

    def _end_processes(self) -> None:
        if isinstance(self._env, AsyncSubEnvs):
            self._env.kill()

    def _close_env(self) -> None:
        if isinstance(self._env, AsyncSubEnvs):
            self._env.close()
        else:
            super()._close_env()

    def start_monitor(self, *_: object) -> None:
        """Refuse: what a monitor writes is about one environment."""
        raise GymServerError(
            "not_supported",
            f"Instance {self.instance_id} has sub-environments, and a monitor records single "
            "environments",
            "create it without num_envs",
        )

    def about(self) -> dict:
        """Return all that is known of the instance, without waiting for its environment."""
        return {
            **super().about(),
            "vectorization_mode": self._mode,
            "autoreset_mode": self._autoreset_mode.value,
            "episode_steps": None,
            "needs_reset": not self._was_reset or bool(self._ended.any()),
        }


def _holds_nothing(space: Space) -> bool:
    """Tell whether a space is an empty Tuple or Dict, or has such a part."""
    match space:
        case Dict() | Tuple():
            parts = space.spaces.values() if isinstance(space, Dict) else space.spaces
            return not parts or any(map(_holds_nothing, parts))
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


def _as_lists(result: dict) -> dict:
    result["done"] = result["terminated"] | result["truncated"]
    return {
        name: value.tolist() if isinstance(value, np.ndarray) else value
        for name, value in result.items()
    }
