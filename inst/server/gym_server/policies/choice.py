"""Draw one of several actions, each with a probability, as R's ``draw_by_row()`` does."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np


class Odds(NamedTuple):
    """How likely each of several actions is.

    Attributes:
        below: the sums of the probabilities of the first action, of the first two, ...; without
            the sum of all.
        last: the index of the last action that can be drawn. The sum of all probabilities may be
            a little below 1.
    """

    below: list[float]
    last: int

    def draw(self, u: float) -> int:
        """Return the index of the action that a uniform number from 0 to 1 stands for."""
        return min(bisect_right(self.below, u), self.last)


def odds(weights: Sequence[float]) -> Odds:
    """Return probabilities that are proportional to weights; their sum must be above 0."""
    # fsum(), because what sum() gives differs between versions of Python.
    total = math.fsum(weights)
    p = [weight / total for weight in weights]
    last = max(index for index, weight in enumerate(p) if weight > 0)
    return Odds(list(accumulate(p[:-1])), last)


def softmax_weights(values: Sequence[float], temperature: float = 1.0) -> list[float]:
    """Return weights that are proportional to ``exp(value / temperature)``."""
    largest = max(values)
    return [math.exp((value - largest) / temperature) for value in values]


def draw_by_weights(weights: Sequence[float], u: float) -> int:
    """Return ``odds(weights).draw(u)``, faster where the odds are needed only once."""
    total = math.fsum(weights)
    below = 0.0
    last = 0
    for index, weight in enumerate(weights):
        if weight > 0:
            below += weight / total
            if u < below:
                return index
            last = index
    return last


def softmax_columns(values: np.ndarray, temperature: float = 1.0) -> np.ndarray:
    """Return the softmax of each column."""
    weights: np.ndarray = np.exp((values - values.max(axis=0)) / temperature)
    weights /= weights.sum(axis=0)
    return weights


def draw_columns(p: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Draw an index for each column of probabilities, by a uniform number for each."""
    below = np.cumsum(p, axis=0)[:-1]
    last = len(p) - 1 - np.argmax(p[::-1] > 0, axis=0)
    chosen: np.ndarray = np.minimum((u >= below).sum(axis=0), last)
    return chosen


def even_columns(possible: np.ndarray) -> np.ndarray:
    """Return for each column the same probability for all that is possible."""
    p: np.ndarray = possible / possible.sum(axis=0)
    return p
