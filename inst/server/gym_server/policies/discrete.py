"""Choose a Discrete action by the values of all actions, like R's policies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.spaces import Discrete

from gym_server.errors import invalid_policy
from gym_server.policies.acting import Actor
from gym_server.policies.draws import uniforms


@dataclass(frozen=True)
class DiscreteChoice:
    """Chooses the first action with the largest value, or draws one.

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

    def actor(
        self, values_of: Callable[[Any], np.ndarray], rows: tuple[int, ...], remembers: bool
    ) -> Actor:
        """Return an actor.

        Args:
            values_of: returns the values, float64[actions, *rows], given an observation or a batch.
            rows: the number of rows of a group; empty for single episodes.
            remembers: whether to remember results by observation, if there are few observations.
        """
        start = int(self.space.start)
        members = np.arange(start, start + int(self.space.n), dtype=self.space.dtype)
        known = _remembered if remembers else lambda find: find
        draws = uniforms(*rows)
        take, epsilon = draws.take, self.epsilon
        if self.temperature is not None:
            softmax = known(lambda it: self._softmax(values_of(it)))
            return Actor(lambda it: members[draw_index(softmax(it), take())], draws)
        if epsilon == 0:
            return Actor(known(lambda it: members[_best(values_of(it))]))
        choices = known(lambda it: self._choices(values_of(it)))

        def explore(observation: Any) -> Any:
            best, possible = choices(observation)
            explores = take() < epsilon
            # Only a group draws for rows that do not explore.
            if not rows and not explores:
                return members[best]
            return members[np.where(explores, draw_index(possible, take()), best)]

        return Actor(explore, draws)

    def _softmax(self, values: np.ndarray) -> np.ndarray:
        """Return the running sums of weights proportional to ``exp(value / temperature)``."""
        scaled = values - np.maximum.reduce(values)
        if self.temperature != 1:
            scaled /= self.temperature
        sums: np.ndarray = np.add.accumulate(np.exp(scaled))
        check_numbers(sums)
        return sums

    def _choices(self, values: np.ndarray) -> tuple[Any, np.ndarray]:
        """Return the best action, and the running sums of equal weights of all possible ones."""
        possible = values > -np.inf if self.masks else np.ones_like(values)
        return _best(values), np.add.accumulate(possible, dtype=np.float64)


def _best(values: np.ndarray) -> Any:
    check_numbers(values)
    if values.ndim == 2 and len(values) == 2:
        # Faster than argmax(), which works across the rows.
        return (values[1] > values[0]).astype(np.intp)
    return values.argmax(axis=0)


def draw_index(sums: np.ndarray, uniform: Any) -> Any:
    """Draw an index, or one for each column, given running sums of weights and uniform numbers."""
    below, drawn = sums[:-1], uniform * sums[-1]
    if below.ndim == 1:
        return below.searchsorted(drawn, "right")
    return np.add.reduce(drawn >= below)


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


def check_numbers(values: np.ndarray) -> None:
    """Refuse weights so large that an output is Inf - Inf."""
    flat = values.ravel()
    # A NaN makes the sum of squares NaN, which one call finds.
    squares = flat.dot(flat)
    if squares != squares:
        raise invalid_policy(
            "An output of the policy's network is not a number",
            "its weights, or the environment's observations, are too large or not finite",
        )
