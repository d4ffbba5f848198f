"""Act by a small neural network, or by weighted sums."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete

from gym_server.policies import inputs, outputs
from gym_server.policies.acting import Actor, GroupActor, Policy
from gym_server.policies.activation import Steps, in_place
from gym_server.policies.draws import Draws, uniforms
from gym_server.policies.memo import remembered
from gym_server.policies.network_group import network_group
from gym_server.policies.network_plan import NetworkPlan


class NetworkPolicy(Policy):
    """Candidates that are networks of the same sizes, with different weights."""

    def __init__(
        self,
        plan: NetworkPlan,
        weights: np.ndarray,
        observation_space: Box | Discrete,
        action_space: Box | Discrete,
    ) -> None:
        """Keep the networks.

        Args:
            plan: what they have in common.
            weights: float64[candidates, weights], in the order of R's ``coef()``: layer after
                layer, each matrix column after column.
            observation_space: what comes in.
            action_space: what goes out.
        """
        self.candidates = len(weights)
        self._plan = plan
        self._weights = weights
        self._observation_space = observation_space
        self._action_space = action_space

    def actor(self, candidate: int) -> Actor:
        """Return an actor whose arrays are laid out once, and computed in place."""
        read, steps, signal = self._forward(self._matrices(candidate))
        draws = self._draws()
        choose = self._chooser(candidate, signal, draws)

        def act(observation: Any) -> Any:
            read(observation)
            for step in steps:
                step()
            return choose()

        if draws is not None:
            return Actor(act, draws)
        can_be_counted = isinstance(self._observation_space, Discrete)
        # An array may be changed by whom it is given to.
        if can_be_counted and isinstance(self._action_space, Discrete):
            return Actor(remembered(act))
        return Actor(act)

    def group_actor(self, candidates: np.ndarray, num_envs: int) -> GroupActor:
        """Return an actor for groups."""
        return network_group(
            self._plan,
            self._weights[candidates],
            candidates,
            self._observation_space,
            self._action_space,
        )

    def _matrices(self, candidate: int) -> list[np.ndarray]:
        pieces = np.split(self._weights[candidate], self._plan.ends[:-1])
        return [
            np.ascontiguousarray(piece.reshape(shape, order="F"))
            for piece, shape in zip(pieces, self._plan.shapes, strict=True)
        ]

    def _forward(self, matrices: list[np.ndarray]) -> tuple[Any, Steps, np.ndarray]:
        """Return what reads an observation, the steps that follow, and where they leave outputs."""
        plan, space = self._plan, self._observation_space
        width = plan.sizes[0]
        source = inputs.with_bias(width, bias=plan.bias)
        read: Any = None
        steps: Steps = []
        if isinstance(space, Box):
            read = inputs.box_reader(space, source[:width])
            steps += inputs.normalizing(source[:width], plan.moments)
        for layer, (matrix, activation) in enumerate(zip(matrices, plan.activation, strict=True)):
            is_last = layer == len(matrices) - 1
            target = inputs.with_bias(len(matrix), bias=plan.bias and not is_last)
            sums = target[: len(matrix)]
            if isinstance(space, Discrete) and layer == 0:
                read = inputs.column_reader(space, _columns(matrix, plan.bias), sums)
            else:
                steps.append(partial(matrix.dot, source, sums))
            if not (is_last and self._is_single):
                steps += in_place(activation, sums)
            source = target
        return read, steps, source

    @property
    def _is_single(self) -> bool:
        """Whether a single output chooses between two actions."""
        return self._plan.is_single(self._action_space)

    def _draws(self) -> Draws | None:
        if self._plan.output == "greedy":
            return None
        if self._plan.output == "gaussian":
            width = self._plan.sizes[-1]
            return Draws(lambda generator, n: list(generator.standard_normal((n, width))))
        return uniforms()

    def _chooser(self, candidate: int, signal: np.ndarray, draws: Draws | None) -> outputs.Choose:
        plan, space = self._plan, self._action_space
        if isinstance(space, Box):
            if draws is None:
                return outputs.box(space, signal, plan.stretched_from)
            assert plan.deviation is not None
            choose = outputs.box(space, signal, None)
            return outputs.noisy(signal, plan.deviation[candidate], draws, choose)
        members = outputs.members_of(space)
        if plan.output == "softmax":
            assert draws is not None
            return outputs.softmax(signal, members, draws)
        index = (
            outputs.index_above_middle(signal, plan.activation[-1])
            if self._is_single
            else outputs.index_of_largest(signal)
        )
        if draws is None:
            return outputs.greedy(index, members)
        return outputs.exploring(index, members, plan.epsilon, draws)


def _columns(matrix: np.ndarray, bias: bool) -> np.ndarray:
    """Return the sums of the first layer for each discrete observation, in rows."""
    columns = np.ascontiguousarray(matrix.T)
    return columns[:-1] + columns[-1] if bias else columns
