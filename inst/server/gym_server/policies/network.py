"""Act by a small neural network, or by weighted sums."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete

from gym_server.policies.acting import Actor, Policy
from gym_server.policies.box import box_actions, clip_to_bounds, drawn_actions
from gym_server.policies.discrete import DiscreteChoice
from gym_server.policies.draws import normals
from gym_server.policies.layers import Forward, NetworkPlan, forward


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
        rows = np.shape(candidate)
        if isinstance(plan.action_space, Box):
            return self._box_actor(plan.action_space, outputs, candidate, rows)
        choice = DiscreteChoice(
            plan.action_space,
            epsilon=(plan.epsilon or 0.0) if plan.output == "epsilon-greedy" else 0.0,
            temperature=1.0 if plan.output == "softmax" else None,
        )
        remembers = not rows and isinstance(plan.observation_space, Discrete)
        return choice.actor(outputs, rows, remembers)

    def _box_actor(
        self, space: Box, outputs: Forward, candidate: int | np.ndarray, rows: tuple[int, ...]
    ) -> Actor:
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
