"""Sub-environments that are played one after another in one process."""

from __future__ import annotations

import contextlib
import copy
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium.spaces import Space
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import concatenate, create_empty_array

from gym_server.envs.drawing_on_demand import allow_drawing, save_drawing
from gym_server.envs.outcomes import checked_info, reward_number
from gym_server.errors import GymServerError, environment_error
from gym_server.spaces.stacking import ARRAYS
from gym_server.vector_envs.sub_env import SubEnv

# The info of a sub-environment's step, or of the reset that followed in the same step; and then the
# info of that step, else None.
Infos = tuple[dict, dict | None]


class Outcome(NamedTuple):
    """The outcome of a step, with a row per sub-environment that stepped.

    Attributes:
        observation: a batch.
        reward: float64.
        terminated: booleans.
        truncated: booleans.
        final: the last observations of episodes that were followed by a reset in the same step, by
            row.
        infos: one per row; empty if none are wanted.
    """

    observation: Any
    reward: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray
    final: dict[int, object]
    infos: list[Infos]


class Group:
    """Some of the sub-environments of a vector environment.

    Attributes:
        envs: the sub-environments.
        render_mode: the render mode of each.
    """

    def __init__(
        self,
        sub_env: SubEnv,
        numbers: Sequence[int],
        autoreset_mode: AutoresetMode,
    ) -> None:
        """Make the sub-environments.

        Args:
            sub_env: makes them.
            numbers: their numbers among all sub-environments, from 0; for errors.
            autoreset_mode: when a sub-environment whose episode ended is reset.
        """
        self._numbers = numbers
        self._mode = autoreset_mode
        with contextlib.ExitStack() as undo:
            self.envs: list[gymnasium.Env] = []
            for env in sub_env.make_all(len(numbers)):
                self.envs.append(env)
                undo.callback(env.close)
            self._check_spaces()
            undo.pop_all()
        self._observation_space = self.envs[0].observation_space
        # Of sub-environments that have not been drawn yet.
        self._render_modes = [save_drawing(env) for env in self.envs]
        self.render_mode = self._render_modes[0] or self.envs[0].render_mode
        self._steps = [env.step for env in self.envs]
        self._last: list[object] = [None] * len(numbers)
        # Whether each has played all episodes for which it had seeds, and does not move any more.
        self._rests = [False] * len(numbers)
        # In mode NEXT_STEP: whether the next step of each starts an episode.
        self._ended = [False] * len(numbers)
        # The seeds of the episodes that each starts automatically, in reverse order; None for
        # endless episodes without seeds.
        self._seeds: list[list[int] | None] = [None] * len(numbers)

    def _check_spaces(self) -> None:
        first = self.envs[0]
        for env in self.envs:
            for name in ("observation_space", "action_space"):
                space, wanted = getattr(env, name), getattr(first, name)
                if space is not wanted and space != wanted:
                    raise RuntimeError(
                        f"its sub-environments differ: one has the {name} {wanted}, "
                        f"another one {space}"
                    )

    # Moves ----------------------------------------------------------------------------------

    def reset(
        self,
        which: Sequence[int],
        seeds: Sequence[int | None],
        later: Sequence[Sequence[int] | None],
        options: dict | None,
    ) -> tuple[Any, list[Infos]]:
        """Start episodes in some sub-environments.

        Args:
            which: their indices in this group.
            seeds: their seeds.
            later: for each, the seeds of the episodes that it starts automatically afterwards,
                until it rests; None for endless episodes without seeds.
            options: options for the environments.

        Returns:
            The observations of all sub-environments as a batch, and the infos of those that were
            reset.
        """
        infos: list[Infos] = []
        for index, seed, seeds_later in zip(which, seeds, later, strict=True):
            # The environment may change its options.
            own = copy.deepcopy(options)
            with self._naming(index):
                self._last[index], info = self.envs[index].reset(seed=seed, options=own)
            infos.append((checked_info(info), None))
            self._ended[index] = self._rests[index] = False
            self._seeds[index] = None if seeds_later is None else list(reversed(seeds_later))
        return stack_observations(self._observation_space, self._last), infos

    def step(
        self, which: Sequence[int] | None, actions: Iterable[object], with_infos: bool
    ) -> Outcome:
        """Step some sub-environments.

        Args:
            which: their indices in this group, in increasing order; None for all. One that rests
                returns its last observation and a reward of 0.
            actions: one for each of them.
            with_infos: whether infos are wanted.
        """
        which = range(len(self.envs)) if which is None else which
        # Evaluate them before any step, while no sub-environment is to blame for an error.
        actions = list(actions)
        if len(actions) != len(which):
            raise ValueError(f"{len(actions)} actions for {len(which)} sub-environments")
        steps, last, ended, rests = self._steps, self._last, self._ended, self._rests
        reward = np.zeros(len(which))
        terminated = np.zeros(len(which), dtype=bool)
        truncated = np.zeros(len(which), dtype=bool)
        final: dict[int, object] = {}
        infos: list[Infos] = []
        info: dict
        index = 0
        try:
            for row, (index, action) in enumerate(zip(which, actions, strict=True)):
                final_info = None
                if rests[index]:
                    info = {}
                elif ended[index]:
                    ended[index] = False
                    last[index], info = self._begin_next(index)
                else:
                    last[index], earned, over, cut, info = steps[index](action)
                    reward[row] = reward_number(earned)
                    terminated[row], truncated[row] = bool(over), bool(cut)
                    if terminated[row] or truncated[row]:
                        if self._mode is AutoresetMode.DISABLED:
                            pass
                        elif self._has_used_its_seeds(index):
                            rests[index] = True
                        elif self._mode is AutoresetMode.NEXT_STEP:
                            ended[index] = True
                        else:
                            # The reset may change the returned observation in place.
                            final[row] = copy.deepcopy(last[index])
                            final_info = _copied(info) if with_infos else None
                            last[index], info = self._begin_next(index)
                if with_infos:
                    final_info = None if final_info is None else checked_info(final_info)
                    infos.append((checked_info(info), final_info))
        except BaseException as failure:
            raise self._named(failure, index) from failure
        observations = last if len(which) == len(last) else [last[index] for index in which]
        return Outcome(
            stack_observations(self._observation_space, observations),
            reward,
            terminated,
            truncated,
            final,
            infos,
        )

    def _has_used_its_seeds(self, index: int) -> bool:
        seeds = self._seeds[index]
        return seeds is not None and not seeds

    def _begin_next(self, index: int) -> tuple[object, dict]:
        seeds = self._seeds[index]
        if seeds is None:
            return self.envs[index].reset()
        return self.envs[index].reset(seed=seeds.pop())

    # Looks ----------------------------------------------------------------------------------

    def render(self, index: int) -> object:
        """Draw a sub-environment."""
        with self._naming(index):
            allow_drawing(self.envs[index], self._render_modes[index])
            return self.envs[index].render()

    def observed(self, index: int) -> object:
        """Return the last observation of a sub-environment."""
        return self._last[index]

    def close(self) -> None:
        """Close all sub-environments, even if some fail; raise the first error."""
        with contextlib.ExitStack() as closing:
            for env in self.envs:
                closing.callback(env.close)

    # Errors ---------------------------------------------------------------------------------

    @contextlib.contextmanager
    def _naming(self, index: int) -> Any:
        try:
            yield
        except BaseException as failure:
            raise self._named(failure, index) from failure

    def _named(self, failure: BaseException, index: int) -> GymServerError:
        if isinstance(failure, GymServerError):
            return failure
        return environment_error(failure, f"Sub-environment {self._numbers[index]}")


# Deeper than any reasonable info. An info that contains itself is cut off here.
_DEEPEST = 128


def _copied(value: Any, depth: int = 0) -> Any:
    """Copy the arrays, dicts and lists of an info; other objects may have no copy."""
    if isinstance(value, np.ndarray):
        return value.copy()
    if depth < _DEEPEST:
        if isinstance(value, dict):
            return {key: _copied(item, depth + 1) for key, item in value.items()}
        if isinstance(value, (list, tuple)):
            return [_copied(item, depth + 1) for item in value]
    return value


def stack_observations(space: Space, observations: list) -> Any:
    """Batch observations, in the format of Gymnasium's vector environments."""
    if isinstance(space, ARRAYS):
        batch: np.ndarray | None
        try:
            batch = np.array(observations)
        except ValueError:
            batch = None
        # Gymnasium's function takes three times as long, but explains what does not fit.
        shape = (len(observations), *(space.shape or ()))
        if batch is not None and batch.dtype == space.dtype and batch.shape == shape:
            return batch
    empty: Any = create_empty_array(space, n=len(observations))
    return concatenate(space, observations, empty)
