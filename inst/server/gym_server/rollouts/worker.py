"""What a process of the pool does for rollouts: describe an environment, and play episodes."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from gym_server.envs.make import call_env
from gym_server.errors import GymServerError, environment_error, logged
from gym_server.policies import read_policy
from gym_server.processes import serve, start
from gym_server.protocol.safetensors import Tensor
from gym_server.rollouts.environment import RolloutEnv
from gym_server.rollouts.episode import Played, play_episode
from gym_server.rollouts.group import play_group
from gym_server.rollouts.recording import Recorder, check_keep, concatenated, result_tensors
from gym_server.rollouts.task import Task, Unit

# Importing it takes longer than starting a process.
start.preload(__name__)

# How long to play before returning the results, so that all processes share the episodes.
_SECONDS = 0.015

# How many environments to keep; enough for two clients at a time.
_MOST_ENVIRONMENTS = 4

_environments: OrderedDict[str, RolloutEnv] = OrderedDict()

# The last task, ready to play.
_playing: _Playing


def describe(task: Task) -> dict:
    """Return the description of a task's environment; see ``RolloutEnv.describe()``."""
    return _environment(task).describe()


def play(
    task: Task | None, units: Sequence[Unit]
) -> tuple[int, dict[str, Tensor], GymServerError | None]:
    """Play for some milliseconds.

    Args:
        task: the task; None for the same as the last time.
        units: the units to play, in this order.

    Returns:
        The number of the first units, which were played; their results; and the error of the next
        unit, if it failed.

    Raises:
        GymServerError: the environment cannot be made, or the policy does not fit.
    """
    global _playing
    if task is not None:
        _playing = _Playing(task)
    done, tensors, error = _playing.play(units)
    return done, tensors, error and logged(error)


def _environment(task: Task) -> RolloutEnv:
    env = _environments.get(task.env_key)
    if env is None:
        env = _environments[task.env_key] = call_env(RolloutEnv, task)
        while len(_environments) > _MOST_ENVIRONMENTS:
            _environments.popitem(last=False)[1].close()
    _environments.move_to_end(task.env_key)
    return env


class _Playing:
    """A task that is ready to play."""

    def __init__(self, task: Task) -> None:
        self._task = task
        env = self._env
        if env.remembers:
            raise GymServerError(
                "not_supported",
                f"{env.remembers[0]} remembers earlier episodes, so they cannot be played "
                "separately",
                "reset and step an instance instead",
            )
        if task.max_steps is None and env.needs_max_steps:
            raise GymServerError(
                "invalid_parameter",
                f"{task.config.env_id} has no time limit, so the parameter 'max_steps' must be "
                "given",
            )
        check_keep(task.keep, env.observation_space, env.action_space)
        self._policy = read_policy(
            task.policy, task.tensors, env.observation_space, env.action_space
        )
        self._actors: dict[int, Any] = {}

    @property
    def _env(self) -> RolloutEnv:
        return _environment(self._task)

    def play(self, units: Sequence[Unit]) -> tuple:
        self._check_rows(units[0])
        due = time.monotonic() + _SECONDS
        play = self._play_episodes if self._env.group is None else self._play_groups
        return play(units, due)

    def _check_rows(self, unit: Unit) -> None:
        group, env_id = self._env.group, self._task.config.env_id
        if group is None and unit.rows is not None:
            raise GymServerError(
                "invalid_parameter",
                f"Episodes of {env_id} are played separately, so the tensor 'row' must be absent",
            )
        if group is not None and unit.rows is None:
            raise GymServerError(
                "missing_parameter",
                f"{env_id} is played in groups of {group}, so the tensor 'row' must have the place "
                "of each episode in its group",
            )

    def _play_episodes(self, units: Sequence[Unit], due: float) -> tuple:
        task, env = self._task, self._env
        keeps = task.keep.moments or task.keep.steps
        recorder = Recorder(task.keep, env.observation_space, env.action_space) if keeps else None
        played: list[Played] = []

        def play(unit: Unit) -> None:
            actor = self._actor(unit.candidates[0])
            if recorder is not None:
                recorder.begin()
            one = play_episode(env.for_an_episode(), actor, unit.seed, task.max_steps, recorder)
            if recorder is not None:
                recorder.end()
            played.append(one)

        error = _play_until(due, units, play)
        tensors = recorder.tensors() if recorder is not None else {}
        columns = zip(*played, strict=True) if played else ((), (), (), ())
        return len(played), {**tensors, **result_tensors(*columns)}, error

    def _play_groups(self, units: Sequence[Unit], due: float) -> tuple:
        env = self._env
        results: list[dict[str, Tensor]] = []
        error = _play_until(due, units, lambda unit: results.append(self._play_group(env, unit)))
        return len(results), concatenated(results), error

    def _play_group(self, env: RolloutEnv, unit: Unit) -> dict[str, Tensor]:
        group = env.env
        candidates = np.full(group.num_envs, -1)
        candidates[list(unit.rows or ())] = unit.candidates
        actor = self._policy.actor(candidates)
        return play_group(group, actor, unit, self._task.max_steps, self._task.keep)

    def _actor(self, candidate: int) -> Any:
        actor = self._actors.get(candidate)
        if actor is None:
            # A candidate's episodes come one after another, so one actor is enough.
            self._actors.clear()
            actor = self._actors[candidate] = self._policy.actor(candidate)
        return actor


def _play_until(
    due: float, units: Sequence[Unit], play: Callable[[Unit], None]
) -> GymServerError | None:
    """Play units until the time is over; return the error of the one that failed, or None."""
    for place, unit in enumerate(units):
        serve.progress[1] = place
        try:
            play(unit)
        except BaseException as failure:
            return _named(failure, unit.seed)
        if time.monotonic() >= due:
            break
    return None


def _named(failure: BaseException, seed: int) -> GymServerError:
    """Add the seed of the failed episode to its error."""
    if not isinstance(failure, GymServerError):
        failure = environment_error(failure)
    return GymServerError(
        failure.code, f"{failure.message} (episode of seed {seed})", failure.hint, failure.extra
    )
