"""Turn a policy's outputs into an action of a Box: its values, or positions between its bounds.

See ``R/policy-network-action.R``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium.spaces import Box

from gym_server.policies.discrete import not_a_number

# Up to this many numbers, Python's floats are faster than NumPy's arrays.
_FEW = 8


def box_actions(space: Box, stretched_from: str | None, rows: int | None) -> Callable[..., Any]:
    """Return a function from float64[numbers], or float64[rows, numbers], to actions.

    Args:
        space: the action space.
        stretched_from: the activation whose range is stretched to the bounds; None if the outputs
            are the values of the action.
        rows: the number of rows; None for a single action.
    """
    low, high = _bounds(space)
    if rows is None and low.size <= _FEW:
        return _of_few(space, low.tolist(), high.tolist(), stretched_from)
    return _of_many(space, low, high, stretched_from, () if rows is None else (rows,))


def drawn_actions(space: Box, rows: int | None) -> Callable[[np.ndarray], Any]:
    """Return a function from float64[numbers], or float64[rows, numbers], to unbounded actions."""
    shape = space.shape if rows is None else (rows, *space.shape)

    def choose(values: np.ndarray) -> Any:
        flat = values.ravel()
        # A NaN makes the sum of squares NaN, which one call finds.
        squares = flat.dot(flat)
        if squares != squares:
            raise not_a_number()
        return values.astype(space.dtype).reshape(shape)

    return choose


def clip_to_bounds(space: Box) -> Callable[[Any], Any]:
    """Return a function that clips an action, or a batch, to the space's bounds."""
    low, high = space.low, space.high
    return lambda action: np.minimum(np.maximum(action, low), high)


def _bounds(space: Box) -> tuple[np.ndarray, np.ndarray]:
    """Return the flat bounds of a Box as float64, never beyond the space's own."""
    low, high = (bound.ravel().astype(np.float64) for bound in (space.low, space.high))
    if space.dtype.kind in "iu" and space.dtype.itemsize == 8:
        # 2^63 - 1 has no float64, and 2^63 is not an int64.
        for index, bound in enumerate(space.high.ravel().tolist()):
            if int(high[index]) > bound:
                high[index] = np.nextafter(high[index], 0)
    return low, high


def _of_few(
    space: Box, lows: list[float], highs: list[float], stretched_from: str | None
) -> Callable[[np.ndarray], Any]:
    bounds, array = list(zip(lows, highs, strict=True)), np.array
    dtype, shape = space.dtype, space.shape
    is_stretched, is_tanh = stretched_from is not None, stretched_from == "tanh"
    is_whole, is_vector = dtype.kind in "iub", len(shape) == 1

    # One loop: three comprehensions take twice as long.
    def choose(outputs: np.ndarray) -> Any:
        values: list[float] = []
        append = values.append
        for value, (low, high) in zip(outputs.tolist(), bounds, strict=True):
            if value != value:
                raise not_a_number()
            if is_stretched:
                share = (value + 1) / 2 if is_tanh else value
                # A sum of two products, because high - low may overflow.
                value = low * (1 - share) + high * share
            append(low if value < low else high if value > high else value)
        action = array(list(map(round, values)) if is_whole else values, dtype)
        return action if is_vector else action.reshape(shape)

    return choose


def _of_many(
    space: Box, low: np.ndarray, high: np.ndarray, stretched_from: str | None, rows: tuple[int, ...]
) -> Callable[[np.ndarray], Any]:
    dtype, shape = space.dtype, (*rows, *space.shape)

    def choose(outputs: np.ndarray) -> Any:
        values = outputs
        if stretched_from is not None:
            share = (outputs + 1) * 0.5 if stretched_from == "tanh" else outputs
            values = low * (1 - share) + high * share
        values = np.minimum(np.maximum(values, low), high)
        flat = values.ravel()
        # A NaN makes the sum of squares NaN, which one call finds.
        squares = flat.dot(flat)
        if squares != squares:
            raise not_a_number()
        return (
            (np.rint(values) if dtype.kind in "iub" else values)
            .astype(dtype, order="C")
            .reshape(shape)
        )

    return choose
