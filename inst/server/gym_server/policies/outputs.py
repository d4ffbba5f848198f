"""From the outputs of a network to an action, one at a time.

``R/policy-network-action.R`` says how. Each function here returns another one, which reads the
array of the outputs and returns the action.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete

from gym_server.errors import GymServerError, invalid_policy
from gym_server.policies.activation import above_middle
from gym_server.policies.choice import draw_by_weights, odds, softmax_weights
from gym_server.policies.draws import Draws

Choose = Callable[[], Any]

# So few numbers Python's own floats reckon with faster than NumPy's arrays.
_FEW = 8


def members_of(space: Discrete) -> list[Any]:
    """Return all actions of a space, as its ``sample()`` gives them."""
    start, kind = int(space.start), space.dtype.type
    return [kind(start + index) for index in range(int(space.n))]


def not_a_number() -> GymServerError:
    """The weights are so large that an output is Inf - Inf."""
    return invalid_policy(
        "An output of the policy's network is not a number",
        "its weights, or the environment's observations, are too large or not finite",
    )


def index_of_largest(outputs: np.ndarray) -> Callable[[], int]:
    """Return what finds the first of the largest outputs."""
    argmax, item = outputs.argmax, outputs.item

    def choose() -> int:
        index: Any = argmax()
        # A NaN counts as the largest.
        largest = item(index)
        if largest != largest:
            raise not_a_number()
        return index  # type: ignore[no-any-return]

    return choose


def index_above_middle(outputs: np.ndarray, activation: str) -> Callable[[], int]:
    """Return what decides between two actions; outputs are sums without their activation."""
    item, above = outputs.item, above_middle(activation)

    def choose() -> int:
        output = item(0)
        if output != output:
            raise not_a_number()
        return 1 if above(output) else 0

    return choose


def greedy(index: Callable[[], int], members: list[Any]) -> Choose:
    """Return what gives the action that is found best."""
    return lambda: members[index()]


def exploring(index: Callable[[], int], members: list[Any], epsilon: float, draws: Draws) -> Choose:
    """Return what gives the best action, or with probability ``epsilon`` any."""
    take, any_action = draws.take, odds([1.0] * len(members))

    def choose() -> Any:
        best = index()
        return members[any_action.draw(take()) if take() < epsilon else best]

    return choose


def softmax(outputs: np.ndarray, members: list[Any], draws: Draws) -> Choose:
    """Return what draws an action by the softmax of the outputs."""
    take, tolist = draws.take, outputs.tolist

    def choose() -> Any:
        weights = softmax_weights(tolist())
        # With an output that is not a number, or infinite, the weights are not numbers.
        if not 0 < sum(weights) < math.inf:
            raise not_a_number()
        return members[draw_by_weights(weights, take())]

    return choose


def noisy(outputs: np.ndarray, deviation: np.ndarray, draws: Draws, choose: Choose) -> Choose:
    """Return what adds normal noise to the outputs before an action is made of them."""
    take, multiply, add = draws.take, np.multiply, np.add

    def choose_noisy() -> Any:
        noise = take()
        multiply(noise, deviation, noise)
        add(outputs, noise, outputs)
        return choose()

    return choose_noisy


def bounds_of_box(space: Box) -> tuple[np.ndarray, np.ndarray]:
    """Return the flat bounds of a Box as float64, none beyond the space's own."""
    low, high = (bound.ravel().astype(np.float64) for bound in (space.low, space.high))
    if space.dtype.kind in "iu" and space.dtype.itemsize == 8:
        # 2^63 - 1 has no float64, and 2^63 is no int64.
        for index, bound in enumerate(space.high.ravel().tolist()):
            if int(high[index]) > bound:
                high[index] = np.nextafter(high[index], 0)
    return low, high


def box(space: Box, outputs: np.ndarray, stretched_from: str | None) -> Choose:
    """Return what makes an action of the outputs.

    Args:
        space: the actions.
        outputs: float64[numbers of an action].
        stretched_from: the activation from whose range the outputs are stretched to the bounds;
            None where they are the numbers of the action themselves.
    """
    if outputs.size <= _FEW:
        return _box_of_few(space, outputs, stretched_from)
    return _box_of_many(space, outputs, stretched_from)


def _box_of_few(space: Box, outputs: np.ndarray, stretched_from: str | None) -> Choose:
    tolist, array = outputs.tolist, np.array
    low_bounds, high_bounds = bounds_of_box(space)
    bounds = list(zip(low_bounds.tolist(), high_bounds.tolist(), strict=True))
    dtype, shape = space.dtype, space.shape
    is_stretched, is_tanh = stretched_from is not None, stretched_from == "tanh"
    is_whole, is_vector = dtype.kind in "iub", len(shape) == 1

    # One loop: three comprehensions take twice as long.
    def choose() -> Any:
        values: list[float] = []
        append = values.append
        for value, (low, high) in zip(tolist(), bounds, strict=True):
            if value != value:
                raise not_a_number()
            if is_stretched:
                share = (value + 1) / 2 if is_tanh else value
                # The sum of two products, because high - low may be beyond the largest number.
                value = low * (1 - share) + high * share
            append(low if value < low else high if value > high else value)
        action = array(list(map(round, values)) if is_whole else values, dtype)
        return action if is_vector else action.reshape(shape)

    return choose


def _box_of_many(space: Box, outputs: np.ndarray, stretched_from: str | None) -> Choose:
    stretched = stretch(space, stretched_from)
    low, high = bounds_of_box(space)
    dtype, shape = space.dtype, space.shape
    is_whole, is_vector = dtype.kind in "iub", len(shape) == 1
    maximum, minimum, ones = np.maximum, np.minimum, np.ones(outputs.size)
    values = np.empty_like(outputs)

    def choose() -> Any:
        maximum(stretched(outputs), low, out=values)
        minimum(values, high, out=values)
        # The sum tells in one call whether to look closer.
        total = values.dot(ones)
        if total != total and np.isnan(values).any():
            raise not_a_number()
        if is_whole:
            np.rint(values, values)
        action = values.astype(dtype)
        return action if is_vector else action.reshape(shape)

    return choose


def stretch(space: Box, stretched_from: str | None) -> Callable[[np.ndarray], np.ndarray]:
    """Return what stretches outputs, the last axis of an array, to the bounds of an action."""
    if stretched_from is None:
        return lambda outputs: outputs
    low, high = bounds_of_box(space)
    one, half = np.array(1.0), np.array(0.5)
    is_tanh = stretched_from == "tanh"

    def stretched(outputs: np.ndarray) -> np.ndarray:
        share = (outputs + one) * half if is_tanh else outputs
        # The sum of two products, because high - low may be beyond the largest number.
        values: np.ndarray = low * (one - share) + high * share
        return values

    return stretched
