"""Python's own loop over one environment, the reference for rollout()."""

from collections.abc import Callable
from functools import cache

import gymnasium
import numpy as np
from gymnasium.wrappers import AtariPreprocessing, FrameStackObservation


def count_steps(env_id: str, policies: list[Callable], episodes: int) -> int:
    """Play some episodes with each policy; seeds count from 0."""
    env = _environment(env_id)
    steps = 0
    for policy in policies:
        for seed in range(episodes):
            observation, _ = env.reset(seed=seed)
            ended = False
            while not ended:
                observation, _, terminated, truncated, _ = env.step(policy(observation))
                ended = terminated or truncated
                steps += 1
    return steps


def make_policies(env_id: str, kind: str, file: str, outputs: int, number: int) -> list[Callable]:
    """Make policies whose numbers are in a file, one after another."""
    env = _environment(env_id)
    return [_policy(env, kind, part, outputs) for part in np.array_split(np.fromfile(file), number)]


@cache
def _environment(env_id: str) -> gymnasium.Env:
    if not env_id.startswith("ALE/"):
        return gymnasium.make(env_id)
    import ale_py

    gymnasium.register_envs(ale_py)
    env = gymnasium.make(env_id, frameskip=1)
    return FrameStackObservation(AtariPreprocessing(env), 4)


def _policy(env: gymnasium.Env, kind: str, numbers: np.ndarray, outputs: int) -> Callable:
    if kind == "random":
        env.action_space.seed(1)
        return lambda observation: env.action_space.sample()
    wide = env.observation_space.dtype == np.float64
    weights = numbers.reshape(outputs, -1).astype(np.float64 if wide else np.float32)
    if kind == "discrete":
        if len(env.observation_space.shape) > 1:
            return lambda observation: int((weights @ observation.ravel()).argmax())
        return lambda observation: int((weights @ observation).argmax())
    space = env.action_space
    middle, half = (space.high + space.low) / 2, (space.high - space.low) / 2
    return lambda observation: middle + half * np.tanh(weights @ observation)
