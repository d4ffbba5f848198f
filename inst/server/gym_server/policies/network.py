"""Act by a small neural network, or by weighted sums."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete

from gym_server.policies.acting import Actor, Policy
from gym_server.policies.activation import of_number
from gym_server.policies.box import box_actions, clip_to_bounds, drawn_actions
from gym_server.policies.discrete import DiscreteChoice, not_a_number
from gym_server.policies.draws import normals
from gym_server.policies.layers import Forward, forward
from gym_server.policies.network_plan import NetworkPlan


@dataclass(frozen=True)
class NetworkPolicy(Policy):
    """Candidates that are networks of the same sizes, with different weights.

    Attributes:
        plan: what they have in common.
        weights: float64[candidates, weights], in the order of R's ``coef()``: layer after layer,
            each matrix column by column.
        deviation: float64[candidates, outputs], the standard deviations of the output "gaussian";
            otherwise None.
    """

    plan: NetworkPlan
    weights: np.ndarray
    deviation: np.ndarray | None

    @property
    def candidates(self) -> int:
        """The number of candidates."""
        return len(self.weights)

    def actor(self, candidate: int | np.ndarray) -> Actor:
        """Return an actor; see ``Policy.actor()``."""
        plan = self.plan
        outputs = forward(plan, self.weights, candidate)
        if isinstance(plan.action_space, Box):
            return self._box_actor(plan.action_space, outputs, candidate)
        choice = DiscreteChoice(
            plan.action_space,
            epsilon=(plan.epsilon or 0.0) if plan.output == "epsilon-greedy" else 0.0,
            temperature=1.0 if plan.output == "softmax" else None,
        )
        if isinstance(candidate, int):
            values_of = self._floats(outputs)
            return choice.actor(values_of, isinstance(plan.observation_space, Discrete))
        return choice.rows_actor(_checked(outputs), len(candidate))

    def _floats(self, outputs: Forward) -> Callable[[Any], list[float]]:
        chooses_by_one = self.plan.sizes[-1] < self.plan.num_values
        name = self.plan.activation[-1]

        def values_of(observation: Any) -> list[float]:
            values: list[float] = outputs(observation).tolist()
            total = sum(values)
            # The sum shows in one call whether to look closer: Inf - Inf is NaN, too.
            if total != total and any(value != value for value in values):
                raise not_a_number()
            if chooses_by_one:
                values[1] = of_number(name, values[1])
            return values

        return values_of

    def _box_actor(self, space: Box, outputs: Forward, candidate: int | np.ndarray) -> Actor:
        rows = None if isinstance(candidate, int) else len(candidate)
        if self.deviation is None:
            choose = box_actions(space, self.plan.stretched_from, rows)
            return Actor(lambda observation: choose(outputs(observation).T))
        choose = drawn_actions(space, rows)
        deviation = self.deviation[candidate]
        draws = normals(*deviation.shape)
        take = draws.take

        def act(observation: Any) -> Any:
            noise = take()
            noise *= deviation
            noise += outputs(observation).T
            return choose(noise)

        actor = Actor(act, draws)
        actor.clip = clip_to_bounds(space)
        return actor


def _checked(outputs: Forward) -> Forward:
    def values_of(observation: Any) -> np.ndarray:
        with np.errstate(over="ignore", invalid="ignore"):
            values = outputs(observation)
        if np.isnan(values).any():
            raise not_a_number()
        return values

    return values_of
