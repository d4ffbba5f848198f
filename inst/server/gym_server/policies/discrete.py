"""Choose one of the actions of a Discrete space by the value of each, as R's policies do."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

import numpy as np
from gymnasium.spaces import Discrete

from gym_server.errors import GymServerError, invalid_policy
from gym_server.policies.acting import Actor
from gym_server.policies.draws import uniforms


@dataclass(frozen=True)
class DiscreteChoice:
    """The first of the actions with the largest value, or one that is drawn.

    For one episode this is Python's floats, with which so few numbers are faster than with NumPy,
    for many rows it is NumPy's arrays.

    Attributes:
        space: the actions.
        epsilon: how often any action is drawn.
        temperature: of the softmax that actions are drawn by, in place of epsilon; None for none.
        masks: whether actions of the value -Inf are never drawn.
    """

    space: Discrete
    epsilon: float = 0.0
    temperature: float | None = None
    masks: bool = False

    def actor(self, values_of: Callable[[Any], list[float]], remembers: bool) -> Actor:
        """Return an actor for single episodes.

        Args:
            values_of: returns the values of the actions, given an observation.
            remembers: whether to look up what was found for the same observation before, where
                there are few observations.
        """
        start, kind = int(self.space.start), self.space.dtype.type
        members = [kind(start + index) for index in range(int(self.space.n))]
        known = _remembered if remembers else lambda find: find
        draws = uniforms()
        take, epsilon, temperature = draws.take, self.epsilon, self.temperature
        if temperature is not None:
            chances_of = known(lambda it: chances(softmax_weights(values_of(it), temperature)))
            return Actor(lambda it: members[bisect_right(chances_of(it), take())], draws)

        def best_of(observation: Any) -> int:
            values = values_of(observation)
            return values.index(max(values))

        if epsilon == 0:
            return Actor(known(lambda it: members[best_of(it)]))
        find = known(best_of)
        possible_of = self._possible_of(values_of)

        def explore(observation: Any) -> Any:
            best = find(observation)
            if take() < epsilon:
                return members[bisect_right(possible_of(observation), take())]
            return members[best]

        return Actor(explore, draws)

    def _possible_of(self, values_of: Callable[[Any], list[float]]) -> Callable[[Any], list[float]]:
        if not self.masks:
            of_all = chances([1.0] * int(self.space.n))
            return lambda it: of_all
        return _remembered(
            lambda it: chances([float(value > -math.inf) for value in values_of(it)])
        )

    def rows_actor(self, values_of: Callable[[Any], np.ndarray], rows: int) -> Actor:
        """Return an actor for the rows of a group.

        Args:
            values_of: returns the values, float64[actions, rows], given a batch of observations.
            rows: how many there are.
        """
        start, dtype = int(self.space.start), self.space.dtype
        explores = self.temperature is None and self.epsilon > 0
        draws = uniforms(2, rows) if explores else uniforms(rows)
        choose = self._softmax_rows if self.temperature is not None else self._best_rows
        choose = self._exploring_rows if explores else choose

        def act(observation: Any) -> np.ndarray:
            return (choose(values_of(observation), draws.take) + start).astype(dtype)

        return Actor(act, draws)

    def _softmax_rows(self, values: np.ndarray, take: Callable[[], np.ndarray]) -> np.ndarray:
        weights = np.exp((values - values.max(axis=0)) / self.temperature)
        total = weights.sum(axis=0)
        if not np.isfinite(total).all():
            raise not_a_number()
        return draw_columns(weights / total, take())

    def _exploring_rows(self, values: np.ndarray, take: Callable[[], np.ndarray]) -> np.ndarray:
        explores, u = take()
        possible = values > -np.inf if self.masks else np.ones_like(values)
        drawn = draw_columns(possible / possible.sum(axis=0), u)
        return np.where(explores < self.epsilon, drawn, self._best_rows(values, take))

    def _best_rows(self, values: np.ndarray, take: object) -> np.ndarray:
        # Of two this is faster than argmax(), which goes across the rows.
        best: np.ndarray = values[1] > values[0] if len(values) == 2 else values.argmax(axis=0)
        return best


def _remembered(find: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a function that finds the same, and looks up what it has found before.

    It forgets nothing. For observations that are arrays it looks nothing up.
    """
    known: dict[Any, Any] = {}

    def look_up(observation: Any) -> Any:
        try:
            return known[observation]
        except KeyError:
            found = known[observation] = find(observation)
            return found
        except TypeError:
            return find(observation)

    return look_up


def softmax_weights(values: Sequence[float], temperature: float = 1.0) -> list[float]:
    """Return weights that are proportional to ``exp(value / temperature)``."""
    largest = max(values)
    return [math.exp((value - largest) / temperature) for value in values]


def chances(weights: Sequence[float]) -> list[float]:
    """Return the sums of the probabilities of the first action, of the first two, and so on.

    Where a uniform number belongs among them, by ``bisect_right()``, is the index of the action
    that it stands for. The sum of all may be a little below 1, so the sums end before the last
    action that can be drawn.
    """
    # fsum(), because what sum() gives differs between versions of Python.
    total = math.fsum(weights)
    if not 0 < total < math.inf:
        raise not_a_number()
    sums = list(accumulate([weight / total for weight in weights]))
    last = len(weights) - 1
    while weights[last] / total == 0:
        last -= 1
    del sums[last:]
    return sums


def draw_columns(p: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Draw an index for each column of probabilities, by a uniform number for each."""
    below = np.cumsum(p, axis=0)[:-1]
    last = len(p) - 1 - np.argmax(p[::-1] > 0, axis=0)
    chosen: np.ndarray = np.minimum((u >= below).sum(axis=0), last)
    return chosen


def not_a_number() -> GymServerError:
    """The weights are so large that an output is Inf - Inf."""
    return invalid_policy(
        "An output of the policy's network is not a number",
        "its weights, or the environment's observations, are too large or not finite",
    )
