"""The episodes of an environment as they go by: their number, and what they returned."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode

# How many returns are kept.
_KEPT = 100


class Standing(NamedTuple):
    """Where an episode stands.

    Attributes:
        episode: its number, from 1; 0 before the first.
        step: how many steps it has taken.
        episode_return: the sum of its rewards so far.
        ended: whether it has ended.
    """

    episode: int
    step: int
    episode_return: float
    ended: bool


class EpisodeStatistics:
    """Counts the episodes of a single environment.

    A class of its own, because plain numbers take 0.1 us a step, and arrays of one element 4.

    Attributes:
        returns: of the last episodes that ended; one that was cut short by a reset is none.
    """

    def __init__(self) -> None:
        """Begin before the first episode."""
        self.returns: deque[float] = deque(maxlen=_KEPT)
        self._episode = 0
        self._step = 0
        self._return = 0.0
        self._ended = False

    def begin(self, mask: np.ndarray | None = None) -> None:
        """Count an episode that begins; one without steps before it was none."""
        if self._step or not self._episode:
            self._episode += 1
        self._step = 0
        self._return = 0.0
        self._ended = False

    def step(self, reward: float, done: bool) -> None:
        """Count a step; what an environment does after an episode's end is no part of it."""
        if self._ended:
            return
        self._step += 1
        self._return += reward
        if done:
            self._ended = True
            self.returns.append(self._return)

    def of(self, sub_env: int) -> Standing:
        """Return where the episode stands."""
        return Standing(self._episode, self._step, self._return, self._ended)


class VectorEpisodeStatistics:
    """Counts the episodes of many sub-environments.

    Attributes:
        returns: of the last episodes that ended, in any sub-environment.
    """

    def __init__(self, num_envs: int, mode: AutoresetMode) -> None:
        """Begin before the first episode of each sub-environment."""
        self.returns: deque[float] = deque(maxlen=_KEPT)
        self._mode = mode
        self._episodes = np.zeros(num_envs, dtype=np.int64)
        self._steps = np.zeros(num_envs, dtype=np.int64)
        self._returns = np.zeros(num_envs)
        # Sub-environments whose next step is a reset, or that wait for one.
        self._ended = np.zeros(num_envs, dtype=bool)

    def begin(self, mask: np.ndarray | None) -> None:
        """Count the episodes that begin in the sub-environments of a mask; None for all of them."""
        sub_envs = slice(None) if mask is None else mask
        self._episodes[sub_envs] += (self._steps[sub_envs] > 0) | (self._episodes[sub_envs] == 0)
        self._clear(sub_envs)

    def _clear(self, sub_envs: slice | np.ndarray) -> None:
        self._steps[sub_envs] = 0
        self._returns[sub_envs] = 0.0
        self._ended[sub_envs] = False

    def step(self, reward: np.ndarray, done: np.ndarray, which: np.ndarray | None) -> None:
        """Count a step of some sub-environments, one row for each; None for all of them."""
        if which is None:
            self._steps += 1
            self._returns += reward
        else:
            self._steps[which] += 1
            self._returns[which] += reward
        again = self._ended if which is None else self._ended[which]
        if _any(again):
            begun = np.flatnonzero(again) if which is None else which[again]
            self._episodes[begun] += 1
            self._clear(begun)
        if _any(done):
            over = np.flatnonzero(done) if which is None else which[done]
            self.returns.extend(self._returns[over].tolist())
            if self._mode is AutoresetMode.SAME_STEP:
                self._episodes[over] += 1
                self._clear(over)
            else:
                self._ended[over] = True

    def of(self, sub_env: int) -> Standing:
        """Return where the episode of a sub-environment stands."""
        return Standing(
            int(self._episodes[sub_env]),
            int(self._steps[sub_env]),
            float(self._returns[sub_env]),
            bool(self._ended[sub_env]),
        )


def _any(flags: np.ndarray) -> bool:
    """Tell whether one is true; ``any()`` takes 2.5 us for 32 of them, and this 0.7."""
    return b"\1" in flags.tobytes()


def facts_of(statistics: EpisodeStatistics | VectorEpisodeStatistics, sub_env: int) -> dict:
    """Return the statistics of a sub-environment's episodes as JSON values for its watchers."""
    standing = statistics.of(sub_env)
    return {
        "state": "ended" if standing.ended else "running",
        "episode": standing.episode,
        "step": standing.step,
        "return": standing.episode_return,
        "returns": list(statistics.returns),
    }
