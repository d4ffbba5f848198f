"""Play a group of episodes in lockstep, with an environment's own vector implementation.

All sub-environments share one generator, so their first episodes depend on the seed and on the
number of sub-environments, which is always the same. Later episodes, which the implementation
starts automatically, are ignored.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Space

from gym_server.processes import serve
from gym_server.protocol.safetensors import Tensor
from gym_server.rollouts.recording import Moments, moment_tensors, result_tensors, step_tensors
from gym_server.rollouts.task import Keep, Unit


def play_group(
    env: Any, actor: Any, unit: Unit, max_steps: int | None, keep: Keep
) -> dict[str, Tensor]:
    """Play the first episode of some sub-environments to its end.

    Args:
        env: the implementation, with as many sub-environments as a group has.
        actor: the policy of all rows; see ``policies``.
        unit: the seed, and the rows to play.
        max_steps: after how many steps an episode is truncated.
        keep: what to keep of the steps.

    Returns:
        The results of these rows, and what was kept of their steps, row by row.
    """
    progress = serve.progress
    rows = np.array(unit.rows)
    earned = np.zeros(env.num_envs)
    lengths = np.zeros(env.num_envs, dtype=np.int64)
    flags = np.zeros((2, env.num_envs), dtype=bool)
    running = np.zeros(env.num_envs, dtype=bool)
    running[rows] = True
    steps: list[tuple] = []
    keeps = keep.moments or keep.steps
    actor.begin(unit.seed)
    observation, _ = env.reset(seed=unit.seed)
    act, clip, step = actor.act, actor.clip, env.step
    taken = 0
    left = len(rows)
    while left:
        action = act(observation)
        before = observation
        stepped = action if clip is None else clip(action)
        observation, reward, terminated, truncated, _ = step(stepped)
        taken += 1
        progress[0] += 1
        np.add(earned, reward, out=earned, where=running)
        if keeps:
            after = np.array(observation) if keep.next_observation else None
            kept = [np.array(value) for value in (before, action, reward, terminated, truncated)]
            steps.append((*kept, after))
        ended = running & (terminated | truncated)
        if taken == max_steps:
            ended = running
        if ended.any():
            lengths[ended] = taken
            flags[:, ended] = terminated[ended], truncated[ended] | ~terminated[ended]
            running = running & ~ended
            left = int(running.sum())
    tensors = result_tensors(earned[rows], lengths[rows], *flags[:, rows])
    if keeps:
        tensors.update(_kept(env, steps, rows, lengths[rows], keep))
    return tensors


def _kept(
    env: Any, steps: list[tuple], rows: np.ndarray, lengths: np.ndarray, keep: Keep
) -> dict[str, Tensor]:
    """Return the steps of all rows, row by row."""
    row = np.repeat(rows, lengths)
    time = np.concatenate([np.arange(length) for length in lengths])
    before = [step[:5] for step in steps]
    columns = [np.stack(column)[time, row] for column in zip(*before, strict=True)]
    observed: Space = env.single_observation_space
    acted: Space = env.single_action_space
    tensors: dict[str, Tensor] = {}
    if keep.moments:
        values = np.split(columns[0].reshape(len(row), -1).astype(np.float64), np.cumsum(lengths))
        tensors.update(moment_tensors([_moments(observed, own) for own in values[:-1]]))
    if keep.steps:
        batches = {"observation": columns[0], "action": columns[1]}
        if keep.next_observation:
            batches["next_observation"] = np.stack([step[5] for step in steps])[time, row]
        reward, terminated, truncated = columns[2:]
        tensors.update(
            step_tensors(batches, observed, acted, reward.astype(np.float64), terminated, truncated)
        )
    return tensors


def _moments(space: Space, values: np.ndarray) -> tuple[int, np.ndarray, np.ndarray]:
    moments = Moments(space)
    moments.add_rows(values)
    return moments.result()
