"""Choose a Discrete action by the values of all actions, like R's policies."""

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
    """Chooses the first action with the largest value, or draws one.

    Single episodes use Python's floats, which are faster than NumPy for so few numbers. Groups use
    NumPy's arrays.

    Attributes:
        space: the action space.
        epsilon: the probability of drawing any action.
        temperature: the temperature of the softmax for drawing actions, instead of epsilon; None
            for no softmax.
        masks: whether actions with the value -Inf are never drawn.
    """

    space: Discrete
    epsilon: float = 0.0
    temperature: float | None = None
    masks: bool = False

    def actor(self, values_of: Callable[[Any], list[float]], remembers: bool) -> Actor:
        """Return an actor for single episodes.

        Args:
            values_of: returns the values of the actions, given an observation.
            remembers: whether to remember results by observation, if there are few observations.
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
            rows: the number of rows.
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
        # For two actions this is faster than argmax(), which works across the rows.
        best: np.ndarray = values[1] > values[0] if len(values) == 2 else values.argmax(axis=0)
        return best


def _remembered(find: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a function with the same results that remembers them by observation.

    It forgets nothing. Results for observations that are arrays are not remembered.
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
    """Return the cumulative probabilities of the actions.

    ``bisect_right()`` of a uniform number in them is the index of an action. Rounding may make the
    sum of all a little less than 1, so the result ends before the last possible action.
    """
    # fsum(), because the result of sum() differs between versions of Python.
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
    """Draw an index for each column of probabilities, given a uniform number for each."""
    below = np.cumsum(p, axis=0)[:-1]
    last = len(p) - 1 - np.argmax(p[::-1] > 0, axis=0)
    chosen: np.ndarray = np.minimum((u >= below).sum(axis=0), last)
    return chosen


def not_a_number() -> GymServerError:
    """Report weights so large that an output is Inf - Inf."""
    return invalid_policy(
        "An output of the policy's network is not a number",
        "its weights, or the environment's observations, are too large or not finite",
    )
