"""Act by networks for all rows of a group, each by the weights of its candidate.

A row's action must not depend, to the last bit, on who plays the other rows. So all rows are always
computed, and only the sizes decide how: a matrix product of all rows adds in another order than
one of some rows, and both in another order than a sum of products.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete

from gym_server.policies import inputs
from gym_server.policies.acting import GroupActor
from gym_server.policies.activation import Steps, in_place
from gym_server.policies.draws import EpisodeGenerator
from gym_server.policies.group_outputs import group_chooser
from gym_server.policies.network_plan import NetworkPlan

# With so many weights a row's own matrices are multiplied number by number; with more, all rows are
# multiplied by the matrices of each candidate.
_FEW_WEIGHTS = 512


def network_group(
    plan: NetworkPlan,
    weights: np.ndarray,
    candidates: np.ndarray,
    observation_space: Box | Discrete,
    action_space: Box | Discrete,
) -> GroupActor:
    """Return an actor for a group.

    Args:
        plan: what the networks have in common.
        weights: float64[rows, weights], the weights of each row.
        candidates: int[rows], equal where the weights are.
        observation_space: of a single episode.
        action_space: of a single episode.
    """
    generator = EpisodeGenerator()
    forward = (
        _by_row(plan, weights, observation_space)
        if plan.ends[-1] <= _FEW_WEIGHTS
        else _by_candidate(plan, weights, candidates, observation_space)
    )
    choose = group_chooser(plan, candidates, action_space, generator)

    def act(observation: Any) -> np.ndarray:
        with np.errstate(over="ignore", invalid="ignore"):
            return choose(forward(observation))

    return GroupActor(act, generator)


def _by_row(
    plan: NetworkPlan, weights: np.ndarray, space: Box | Discrete
) -> Callable[[Any], np.ndarray]:
    """Return what computes the outputs, float64[outputs, rows], in sums of products."""
    rows, width = len(weights), plan.sizes[0]
    source = inputs.with_bias(width, rows, bias=plan.bias)
    read = _transposed_reader(space, source[:width])
    steps = inputs.normalizing(source[:width], plan.moments)
    pieces = np.split(weights, plan.ends[:-1], axis=1)
    for layer, (neurons, taken) in enumerate(plan.shapes):
        is_last = layer == len(pieces) - 1
        target = inputs.with_bias(neurons, rows, bias=plan.bias and not is_last)
        sums = target[:neurons]
        by_input = np.ascontiguousarray(
            pieces[layer].reshape(rows, taken, neurons).transpose(1, 2, 0)
        )
        if isinstance(space, Discrete) and layer == 0:
            read = _gathered_reader(space, by_input, plan.bias, sums)
        else:
            steps += _sum_of_products(by_input, source, sums)
        steps += in_place(plan.activation[layer], sums)
        source = target
    return _pass(read, steps, source)


def _sum_of_products(by_input: np.ndarray, source: np.ndarray, sums: np.ndarray) -> Steps:
    products = np.empty_like(by_input)
    return [
        partial(np.multiply, by_input, source[:, np.newaxis, :], products),
        partial(np.add.reduce, products, 0, None, sums),
    ]


def _pass(read: Callable[[Any], None], steps: Steps, out: np.ndarray) -> Callable[..., np.ndarray]:
    def forward(observation: Any) -> np.ndarray:
        read(observation)
        for step in steps:
            step()
        return out

    return forward


def _transposed_reader(space: Box | Discrete, source: np.ndarray) -> Callable[[Any], None]:
    rows = source.shape[1]

    def read(observation: Any) -> None:
        try:
            np.copyto(source, np.asarray(observation).reshape(rows, -1).T)
        except (ValueError, TypeError):
            raise inputs.misfit(observation) from None

    return read


def _gathered_reader(
    space: Discrete, by_input: np.ndarray, bias: bool, sums: np.ndarray
) -> Callable[[Any], None]:
    indices = inputs.indices_of(space)
    rows = np.arange(by_input.shape[2])

    def read(observation: Any) -> None:
        chosen = by_input[indices(observation), :, rows].T
        sums[...] = chosen + by_input[-1] if bias else chosen

    return read


def _by_candidate(
    plan: NetworkPlan, weights: np.ndarray, candidates: np.ndarray, space: Box | Discrete
) -> Callable[[Any], np.ndarray]:
    """Return what computes the outputs of all rows by each candidate, and takes each row's own."""
    result = np.empty((plan.sizes[-1], len(weights)))
    parts = []
    for candidate in np.unique(candidates):
        own = np.flatnonzero(candidates == candidate)
        parts.append((own, _by_matrices(plan, weights[own[0]], len(weights), space)))

    def forward(observation: Any) -> np.ndarray:
        for own, outputs in parts:
            result[:, own] = outputs(observation)[own].T
        return result

    return forward


def _by_matrices(
    plan: NetworkPlan, weights: np.ndarray, rows: int, space: Box | Discrete
) -> Callable[[Any], np.ndarray]:
    """Return what computes the outputs, float64[rows, outputs], by one candidate."""
    width = plan.sizes[0]
    # By column, so that inputs and constant lie apart.
    source = inputs.with_bias(width, rows, bias=plan.bias)
    read = _transposed_reader(space, source[:width])
    steps = inputs.normalizing(source[:width], plan.moments)
    pieces = np.split(weights, plan.ends[:-1])
    for layer, (neurons, taken) in enumerate(plan.shapes):
        is_last = layer == len(pieces) - 1
        target = inputs.with_bias(neurons, rows, bias=plan.bias and not is_last)
        sums = target[:neurons]
        matrix = np.ascontiguousarray(pieces[layer].reshape(taken, neurons).T)
        if isinstance(space, Discrete) and layer == 0:
            read = _columns_reader(space, matrix, plan.bias, sums)
        else:
            steps.append(partial(np.matmul, matrix, source, sums))
        steps += in_place(plan.activation[layer], sums)
        source = target
    return _pass(read, steps, source.T)


def _columns_reader(
    space: Discrete, matrix: np.ndarray, bias: bool, sums: np.ndarray
) -> Callable[[Any], None]:
    indices = inputs.indices_of(space)

    def read(observation: Any) -> None:
        chosen = matrix[:, indices(observation)]
        sums[...] = chosen + matrix[:, -1:] if bias else chosen

    return read
