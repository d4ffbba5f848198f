"""Play one episode in an environment of its own."""

from __future__ import annotations

from typing import Any, NamedTuple

from gym_server.envs.outcomes import reward_number
from gym_server.processes import serve
from gym_server.rollouts.recording import Recorder


class Played(NamedTuple):
    """The outcome of an episode.

    Attributes:
        earned: its return, the sum of its rewards.
        length: its number of steps.
        terminated: whether the environment's own rules ended it.
        truncated: whether a limit of steps ended it, the environment's or ``max_steps``.
    """

    earned: float
    length: int
    terminated: bool
    truncated: bool


def play_episode(
    env: Any, actor: Any, seed: int, max_steps: int | None, recorder: Recorder | None
) -> Played:
    """Play one episode from start to end.

    Args:
        env: the environment, which must play like a new one.
        actor: the policy; see ``policies``.
        seed: the seed of the environment and of the policy's draws.
        max_steps: after how many steps the episode is truncated.
        recorder: records each step; None to keep no steps.
    """
    progress = serve.progress
    actor.begin(seed)
    observation, _ = env.reset(seed=seed)
    act, clip, step = actor.act, actor.clip, env.step
    earned = 0.0
    length = 0
    terminated = truncated = False
    while not (terminated or truncated or length == max_steps):
        action = act(observation)
        if recorder is not None:
            recorder.before(observation, action)
        if clip is not None:
            action = clip(action)
        observation, reward, terminated, truncated, _ = step(action)
        try:
            reward = float(reward)
        except TypeError:
            reward = reward_number(reward)
        earned += reward
        length += 1
        progress[0] += 1
        if recorder is not None:
            recorder.after(observation, reward, terminated, truncated)
    return Played(earned, length, bool(terminated), bool(truncated or not terminated))
