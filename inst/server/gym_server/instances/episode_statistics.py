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


class Tally:
    """Counts the episodes of a single environment.

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

    def begin(self) -> None:
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

    def of(self, lane: int) -> Standing:
        """Return where the episode stands."""
        return Standing(self._episode, self._step, self._return, self._ended)


class LaneTally:
    """Counts the episodes of many lanes.

    Attributes:
        returns: of the last episodes that ended, in any lane.
    """

    def __init__(self, lanes: int, mode: AutoresetMode) -> None:
        """Begin before the first episode of each lane."""
        self.returns: deque[float] = deque(maxlen=_KEPT)
        self._mode = mode
        self._episodes = np.zeros(lanes, dtype=np.int64)
        self._steps = np.zeros(lanes, dtype=np.int64)
        self._returns = np.zeros(lanes)
        # Lanes whose next step is a reset, or that wait for one.
        self._ended = np.zeros(lanes, dtype=bool)

    def begin(self, mask: np.ndarray | None) -> None:
        """Count the episodes that begin in the lanes of a mask; None for all of them."""
        lanes = slice(None) if mask is None else mask
        self._episodes[lanes] += (self._steps[lanes] > 0) | (self._episodes[lanes] == 0)
        self._clear(lanes)

    def _clear(self, lanes: slice | np.ndarray) -> None:
        self._steps[lanes] = 0
        self._returns[lanes] = 0.0
        self._ended[lanes] = False

    def step(self, reward: np.ndarray, ended: np.ndarray, lanes: np.ndarray | None) -> None:
        """Count a step of some lanes, one row for each; None for all of them."""
        rows = slice(None) if lanes is None else lanes
        again = self._ended[rows]
        self._steps[rows] += 1
        self._returns[rows] += reward
        if again.any():
            begun = np.flatnonzero(again) if lanes is None else lanes[again]
            self._episodes[begun] += 1
            self._clear(begun)
        if ended.any():
            over = np.flatnonzero(ended) if lanes is None else lanes[ended]
            self.returns.extend(self._returns[over].tolist())
            if self._mode is AutoresetMode.SAME_STEP:
                self._episodes[over] += 1
                self._clear(over)
            else:
                self._ended[over] = True

    def of(self, lane: int) -> Standing:
        """Return where the episode of a lane stands."""
        return Standing(
            int(self._episodes[lane]),
            int(self._steps[lane]),
            float(self._returns[lane]),
            bool(self._ended[lane]),
        )


def told(tally: Tally | LaneTally, lane: int) -> dict:
    """Return as JSON values what watchers of a lane are told of its episodes."""
    standing = tally.of(lane)
    return {
        "state": "ended" if standing.ended else "running",
        "episode": standing.episode,
        "step": standing.step,
        "return": standing.episode_return,
        "returns": list(tally.returns),
    }
