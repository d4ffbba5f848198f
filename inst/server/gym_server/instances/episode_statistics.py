"""Statistics of an environment's episodes: their number and returns."""

from __future__ import annotations

from collections import deque

import numpy as np
from gymnasium.vector import AutoresetMode

# How many returns are kept.
_KEPT = 100


class EpisodeStatistics:
    """Counts the episodes of a single environment.

    A class of its own, because plain numbers take 0.1 us per step, and arrays of one element 4.

    Attributes:
        returns: the returns of the last episodes that ended; not of those cut short by a reset.
    """

    def __init__(self) -> None:
        """Start before the first episode."""
        self.returns: deque[float] = deque(maxlen=_KEPT)
        self._episode = 0
        self._step = 0
        self._return = 0.0
        self._ended = False

    def begin(self, mask: np.ndarray | None = None) -> None:
        """Count a new episode; a previous one without steps does not count."""
        if self._step or not self._episode:
            self._episode += 1
        self._step = 0
        self._return = 0.0
        self._ended = False

    def step(self, reward: float, done: bool) -> None:
        """Count a step; steps after the end of an episode do not count."""
        if self._ended:
            return
        self._step += 1
        self._return += reward
        if done:
            self._ended = True
            self.returns.append(self._return)

    def of(self, sub_env: int) -> dict:
        """Return the state of the episode, and the returns of earlier ones, as JSON values."""
        return {
            "state": "ended" if self._ended else "running",
            "episode": self._episode,
            "step": self._step,
            "return": self._return,
            "returns": list(self.returns),
        }


class VectorEpisodeStatistics:
    """Counts the episodes of many sub-environments.

    Attributes:
        returns: the returns of the last episodes that ended, in any sub-environment.
    """

    def __init__(self, num_envs: int, mode: AutoresetMode) -> None:
        """Start before the first episode of each sub-environment."""
        self.returns: deque[float] = deque(maxlen=_KEPT)
        self._mode = mode
        self._episodes = np.zeros(num_envs, dtype=np.int64)
        self._steps = np.zeros(num_envs, dtype=np.int64)
        self._returns = np.zeros(num_envs)
        # Sub-environments that will be reset by the next step, or wait for a reset.
        self._ended = np.zeros(num_envs, dtype=bool)

    def begin(self, mask: np.ndarray | None) -> None:
        """Count the episodes that start in the sub-environments of a mask; None for all."""
        sub_envs = slice(None) if mask is None else mask
        self._episodes[sub_envs] += (self._steps[sub_envs] > 0) | (self._episodes[sub_envs] == 0)
        self._clear(sub_envs)

    def _clear(self, sub_envs: slice | np.ndarray) -> None:
        self._steps[sub_envs] = 0
        self._returns[sub_envs] = 0.0
        self._ended[sub_envs] = False

    def step(self, reward: np.ndarray, done: np.ndarray, which: np.ndarray | None) -> None:
        """Count a step of some sub-environments, one row each; None for all."""
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

    def of(self, sub_env: int) -> dict:
        """Return the state of a sub-environment's episode, and the returns of all earlier ones."""
        return {
            "state": "ended" if self._ended[sub_env] else "running",
            "episode": int(self._episodes[sub_env]),
            "step": int(self._steps[sub_env]),
            "return": float(self._returns[sub_env]),
            "returns": list(self.returns),
        }


def _any(flags: np.ndarray) -> bool:
    """Return whether a flag is true, in 0.7 us for 32 flags; ``any()`` takes 2.5."""
    return b"\1" in flags.tobytes()
