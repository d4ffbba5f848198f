"""Compute the outputs of networks for one observation or a batch, in preallocated arrays.

A row's outputs must not depend on the other rows, to the last bit. So only the sizes decide how
they are computed: a matrix product of many rows adds in another order than one of few rows, and
both in another order than a sum of products.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import accumulate
from math import prod
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete

from gym_server.errors import GymServerError
from gym_server.json_values import brief
from gym_server.policies.activation import HAVE_RANGE, Steps, in_place, middle
from gym_server.policies.states import NOT_A_STATE, states_of

# Up to this many weights, the matrices of each row are multiplied number by number. With more
# weights, the rows of a block are multiplied together, by the matrices of each candidate that plays
# one of them. Blocks always start at the same rows, and blocks that nobody plays are left out.
_FEW_WEIGHTS = 512
_BLOCK = 32


@dataclass(frozen=True)
class NetworkPlan:
    """Everything about a network except its weights.

    Attributes:
        observation_space: the space of the inputs.
        action_space: the space of the outputs.
        sizes: the numbers of inputs, neurons of each hidden layer, and outputs.
        activation: the activation of each layer after the inputs.
        bias: whether each neuron has a bias, the last column of its layer's matrix.
        output: "greedy", "softmax", "gaussian" or "epsilon-greedy".
        epsilon: how often "epsilon-greedy" explores; None if not given.
        mean, scale: float64[inputs], which normalize inputs by ``(x - mean) * scale``; None for no
            normalization.
        clip_obs: where to clip normalized inputs, on both sides of 0; None for no clipping.
    """

    observation_space: Box | Discrete
    action_space: Box | Discrete
    sizes: tuple[int, ...]
    activation: tuple[str, ...]
    bias: bool
    output: str
    epsilon: float | None
    mean: np.ndarray | None = None
    scale: np.ndarray | None = None
    clip_obs: float | None = None

    @cached_property
    def shapes(self) -> list[tuple[int, int]]:
        """The shape of each layer's matrix: a row per neuron, a column per input."""
        return [
            (neurons, taken + self.bias)
            for taken, neurons in zip(self.sizes[:-1], self.sizes[1:], strict=True)
        ]

    @cached_property
    def ends(self) -> list[int]:
        """Where each layer's weights end; the last one is the number of weights."""
        return list(accumulate(prod(shape) for shape in self.shapes))

    @property
    def num_values(self) -> int:
        """The number of values to choose an action by: two even for a single output."""
        space = self.action_space
        return int(space.n) if isinstance(space, Discrete) else self.sizes[-1]

    @property
    def stretched_from(self) -> str | None:
        """The activation whose range is stretched to the bounds of a Box; None for no stretching.

        With noise, the outputs are the values of the action.
        """
        last = self.activation[-1]
        return last if last in HAVE_RANGE and self.output == "greedy" else None


Forward = Callable[[Any], np.ndarray]


def forward(plan: NetworkPlan, weights: np.ndarray, candidate: int | np.ndarray) -> Forward:
    """Return a function that computes outputs, float64[outputs] or float64[outputs, rows].

    If a single output chooses between two actions, a row with the middle of its range comes first,
    as the value of the first action.

    Args:
        plan: what the networks have in common.
        weights: float64[candidates, weights].
        candidate: the candidate; for a group int[rows], see ``Policy.actor()``.
    """
    if isinstance(candidate, int):
        return _layers(plan, _matrices(plan, weights[candidate]), ())
    if plan.ends[-1] <= _FEW_WEIGHTS and not isinstance(plan.observation_space, Discrete):
        return _layers(plan, _matrices(plan, weights[candidate].T), candidate.shape)
    return _by_candidate(plan, weights, candidate)


def _by_candidate(plan: NetworkPlan, weights: np.ndarray, candidates: np.ndarray) -> Forward:
    """Return a function that computes the blocks of each candidate, and selects its rows."""
    rows = len(candidates)
    parts = []
    for candidate in np.unique(candidates[candidates >= 0]):
        matrices = _matrices(plan, weights[candidate])
        for first in range(0, rows, _BLOCK):
            block = slice(first, min(first + _BLOCK, rows))
            own = candidates[block] == candidate
            if own.any():
                of_block = _layers(plan, matrices, own.shape)
                parts.append((block, slice(None) if own.all() else own, of_block))
    result = np.zeros((plan.num_values, rows))

    def outputs(observation: Any) -> np.ndarray:
        for block, own, of_block in parts:
            result[:, block][:, own] = of_block(observation[block])[:, own]
        return result

    return outputs


def _matrices(plan: NetworkPlan, weights: np.ndarray) -> list[np.ndarray]:
    """Return float64[inputs, neurons] for each layer, or float64[inputs, neurons, rows]."""
    pieces = np.split(weights, plan.ends[:-1])
    return [
        piece.reshape(taken, neurons, *weights.shape[1:])
        for piece, (neurons, taken) in zip(pieces, plan.shapes, strict=True)
    ]


def _layers(plan: NetworkPlan, matrices: list[np.ndarray], rows: tuple[int, ...]) -> Forward:
    width = plan.sizes[0]
    # Below the inputs of each layer there is a 1 for the bias.
    source = np.ones((width + plan.bias, *rows))
    read: Any = None
    steps: Steps = []
    if isinstance(plan.observation_space, Box):
        read = _reader(plan.observation_space, source[:width])
        steps += _normalizing(plan, source[:width])
    for layer, (matrix, activation) in enumerate(zip(matrices, plan.activation, strict=True)):
        neurons = matrix.shape[1]
        if layer < len(matrices) - 1:
            target = np.ones((neurons + plan.bias, *rows))
            sums = target[:neurons]
        else:
            target = np.full((plan.num_values, *rows), middle(activation))
            sums = target[-neurons:]
        if layer == 0 and isinstance(plan.observation_space, Discrete):
            read = _column_reader(plan.observation_space, matrix, plan.bias, sums)
        else:
            steps += _product(matrix, source, sums)
        steps += in_place(activation, sums)
        source = target

    def outputs(observation: Any) -> np.ndarray:
        read(observation)
        for step in steps:
            step()
        return source

    return outputs


def _product(matrix: np.ndarray, source: np.ndarray, sums: np.ndarray) -> Steps:
    if matrix.ndim == 2:
        return [partial(np.ascontiguousarray(matrix.T).dot, source, sums)]
    by_input = np.ascontiguousarray(matrix)
    products = np.empty_like(by_input)
    return [
        partial(np.multiply, by_input, source[:, np.newaxis, :], products),
        partial(np.add.reduce, products, 0, None, sums),
    ]


def _reader(space: Box, inputs: np.ndarray) -> Callable[[Any], None]:
    """Return a function that copies an observation, or a batch, into an array."""
    # The target has the observation's shape: a copy that changes the shape takes longer.
    target = inputs.T.reshape(*inputs.shape[1:], *space.shape)
    copyto = np.copyto

    def read(observation: Any) -> None:
        try:
            copyto(target, observation)
        except (ValueError, TypeError):
            raise _misfit(observation) from None

    return read


def _column_reader(
    space: Discrete, matrix: np.ndarray, bias: bool, sums: np.ndarray
) -> Callable[[Any], None]:
    """Return a function that copies the sums of the first layer for discrete observations.

    A discrete observation is one input of 1 among zeros, so the sums are a column of the weights.
    """
    columns = matrix[:-1] + matrix[-1] if bias else matrix
    states = states_of(space)
    assert states is not None

    def index(observation: Any) -> int:
        try:
            return states.index(observation)
        except NOT_A_STATE:
            raise _misfit(observation) from None

    def read(observation: Any) -> None:
        sums[...] = columns[index(observation)]

    def read_rows(observation: Any) -> None:
        sums[...] = columns[[index(one) for one in observation]].T

    return read if sums.ndim == 1 else read_rows


def _normalizing(plan: NetworkPlan, inputs: np.ndarray) -> Steps:
    """Return the calls that normalize inputs in place."""
    if plan.mean is None or plan.scale is None:
        return []
    across = (-1,) + (1,) * (inputs.ndim - 1)
    mean, scale = plan.mean.reshape(across), plan.scale.reshape(across)
    steps: Steps = [
        partial(np.subtract, inputs, mean, inputs),
        partial(np.multiply, inputs, scale, inputs),
    ]
    if plan.clip_obs is not None:
        steps.append(partial(inputs.clip, -plan.clip_obs, plan.clip_obs, inputs))
    return steps


def _misfit(observation: Any) -> GymServerError:
    """Report an observation that is not in the environment's observation space."""
    return GymServerError(
        "environment_error",
        f"The environment's observation {brief(observation)} is not in its observation space",
    )
