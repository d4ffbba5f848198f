"""From the outputs of networks to the actions of all rows of a group."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from gymnasium.spaces import Box, Discrete

from gym_server.policies.activation import rows_above_middle
from gym_server.policies.choice import draw_columns, even_columns, softmax_columns
from gym_server.policies.draws import EpisodeGenerator
from gym_server.policies.network_plan import NetworkPlan
from gym_server.policies.outputs import bounds_of_box, not_a_number, stretch

Chooser = Callable[[np.ndarray], np.ndarray]


def group_chooser(
    plan: NetworkPlan,
    candidates: np.ndarray,
    space: Box | Discrete,
    generator: EpisodeGenerator,
) -> Chooser:
    """Return a function from outputs, float64[outputs, rows], to actions.

    What is drawn is drawn for all rows.
    """
    choose = (
        _box(plan, candidates, space, generator)
        if isinstance(space, Box)
        else _discrete(plan, space, generator)
    )

    def choose_numbers(outputs: np.ndarray) -> np.ndarray:
        if np.isnan(outputs).any():
            raise not_a_number()
        return choose(outputs)

    return choose_numbers


def _discrete(plan: NetworkPlan, space: Discrete, generator: EpisodeGenerator) -> Chooser:
    start, dtype = int(space.start), space.dtype
    index = {"softmax": _softmax, "epsilon-greedy": _exploring}.get(plan.output)

    def choose(outputs: np.ndarray) -> np.ndarray:
        chosen = index(plan, space, generator, outputs) if index else _greedy(plan, space, outputs)
        return (chosen + start).astype(dtype)

    return choose


def _greedy(plan: NetworkPlan, space: Discrete, outputs: np.ndarray) -> np.ndarray:
    chosen: np.ndarray
    if plan.is_single(space):
        chosen = rows_above_middle(plan.activation[-1], outputs[0])
    elif len(outputs) == 2:
        # Faster than argmax(), which goes across the rows.
        chosen = outputs[1] > outputs[0]
    else:
        chosen = outputs.argmax(axis=0)
    return chosen


def _softmax(
    plan: NetworkPlan, space: Discrete, generator: EpisodeGenerator, outputs: np.ndarray
) -> np.ndarray:
    return draw_columns(softmax_columns(outputs), generator.uniforms(outputs.shape[1]))


def _exploring(
    plan: NetworkPlan, space: Discrete, generator: EpisodeGenerator, outputs: np.ndarray
) -> np.ndarray:
    rows = outputs.shape[1]
    explores, u = generator.uniforms(2, rows)
    drawn = draw_columns(even_columns(np.ones((int(space.n), rows))), u)
    return np.where(explores < plan.epsilon, drawn, _greedy(plan, space, outputs))


def _box(
    plan: NetworkPlan, candidates: np.ndarray, space: Box, generator: EpisodeGenerator
) -> Chooser:
    low, high = bounds_of_box(space)
    stretched = stretch(space, plan.stretched_from)
    deviation = plan.deviation[candidates] if plan.deviation is not None else None
    shape, dtype, is_whole = (len(candidates), *space.shape), space.dtype, space.dtype.kind in "iub"

    def choose(outputs: np.ndarray) -> np.ndarray:
        values = np.ascontiguousarray(outputs.T)
        if deviation is not None:
            values = values + deviation * generator.get().standard_normal(values.shape)
        values = np.minimum(np.maximum(stretched(values), low), high)
        if is_whole:
            values = np.rint(values)
        actions: np.ndarray = values.astype(dtype).reshape(shape)
        return actions

    return choose
