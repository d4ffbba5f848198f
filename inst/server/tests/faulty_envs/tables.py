"""Environments with tables of their transitions, valid and invalid ones."""

import gymnasium
import numpy as np
from gymnasium import spaces

from faulty_envs.counting import Counting

_STAYS = [(1.0, 0, 0.0, False)]
_ITSELF: list = []
_ITSELF.append(_ITSELF)


def _with(outcomes):
    """Return a table of two states and actions, with given outcomes of one action."""
    return {0: {0: _STAYS, 1: _STAYS}, 1: {0: _STAYS, 1: outcomes}}


TABLES = {
    "sound": _with([(0.25, 0, 1, False), (0.0, 1, 2, True), (0.75, 1, -3.5, True)]),
    "of NumPy": _with(
        [
            (np.float32(0.5), np.uint8(1), np.float32(0.1), np.bool_(True)),
            [np.float64(0.5), np.int64(0), np.int16(-100), np.False_],
        ]
    ),
    "a number": 7,
    "nothing": {},
    "no such state": {0: {0: _STAYS, 1: _STAYS}},
    "no such action": {0: {0: _STAYS, 1: _STAYS}, 1: {0: _STAYS}},
    "names": {"0": {"0": _STAYS}},
    "an array": _with(np.ones((1, 4))),
    "no transitions": _with([]),
    "itself": _with(_ITSELF),
    "no transition": _with([0]),
    "three elements": _with([(1.0, 0, 0.0)]),
    "a text": _with(["1100"]),
    "half a probability": _with([(0.5, 0, 0.0, False)]),
    "two probabilities": _with(2 * _STAYS),
    "a negative probability": _with([(-0.5, 0, 0.0, False), (1.5, 1, 0.0, False)]),
    "a probability that is NaN": _with([(np.nan, 0, 0.0, False)]),
    "a probability that is a text": _with([("1", 0, 0.0, False)]),
    "a state beyond the last": _with([(1.0, 2, 0.0, False)]),
    "a state before the first": _with([(1.0, -1, 0.0, False)]),
    "half a state": _with([(1.0, 0.5, 0.0, False)]),
    "no state": _with([(1.0, None, 0.0, False)]),
    "an infinite reward": _with([(1.0, 0, -np.inf, False)]),
    "a reward that is NaN": _with([(1.0, 0, np.float32("nan"), False)]),
    "a reward of many digits": _with([(1.0, 0, 10**400, False)]),
}

STARTS = {
    "sound": np.array([0.25, 0.75]),
    "a list": [0, 1],
    "too short": np.ones(1),
    "too long": np.array([0.5, 0.5, 0.0]),
    "a number": 1.0,
    "a matrix": np.array([[0.5, 0.5], [0.0, 0.0]]),
    "negative": np.array([-0.5, 1.5]),
    "not a number": np.array([np.nan, 1.0]),
    "infinite": np.array([np.inf, 0.0]),
    "two probabilities": np.ones(2),
}


class Table(Counting):
    """Has a table, a start distribution and spaces, by name; it does not move by them."""

    action_space = spaces.Discrete(2)

    def __init__(self, P="sound", start="sound", n=2, first=0, box=False):  # noqa: N803
        super().__init__()
        self._table = P
        if start != "none":
            self.initial_state_distrib = STARTS[start]
        self.observation_space = spaces.Discrete(n, start=first)
        if box:
            self.action_space = spaces.Box(0, 1)

    @property
    def P(self):  # noqa: N802
        if self._table == "raises":
            raise RuntimeError("the table is gone")
        return TABLES[self._table]

    def observe(self):
        return int(self.observation_space.start)


class _TimeLimit(gymnasium.wrappers.TimeLimit):
    """A subclass of TimeLimit that changes rewards."""

    def step(self, action):
        observation, reward, *others = super().step(action)
        return observation, -reward, *others


def LooksTimed():  # noqa: N802
    """Make an environment with this wrapper."""
    return _TimeLimit(Table(), 100)
