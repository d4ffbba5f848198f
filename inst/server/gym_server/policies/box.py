"""Turn a policy's outputs into an action of a Box: its values, or positions between its bounds.

See ``R/policy-network-action.R``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium.spaces import Box

from gym_server.policies.discrete import check_numbers

# Arrays, because NumPy would make one of a number at each step.
_ONE, _HALF = np.array(1.0), np.array(0.5)


def box_actions(
    space: Box, stretched_from: str | None, rows: tuple[int, ...]
) -> Callable[[np.ndarray], Any]:
    """Return a function from float64[*rows, numbers] to actions.

    Args:
        space: the action space.
        stretched_from: the activation whose range is stretched to the bounds; None if the outputs
            are the values of the action.
        rows: the number of rows of a group; empty for a single action.
    """
    low, high = _bounds(space)
    dtype, shape = space.dtype, (*rows, *space.shape)
    is_whole = dtype.kind in "iub"
    minimum, maximum, rint = np.minimum, np.maximum, np.rint

    def choose(values: np.ndarray) -> Any:
        if stretched_from is not None:
            share = (values + _ONE) * _HALF if stretched_from == "tanh" else values
            # A sum of two products, because high - low may overflow.
            values = low * (_ONE - share) + high * share
        values = minimum(maximum(values, low), high)
        check_numbers(values)
        if is_whole:
            values = rint(values)
        return values.astype(dtype, order="C").reshape(shape)

    return choose


def drawn_actions(space: Box, rows: tuple[int, ...]) -> Callable[[np.ndarray], Any]:
    """Return a function from float64[*rows, numbers] to actions that may be out of bounds."""
    shape = (*rows, *space.shape)

    def choose(values: np.ndarray) -> Any:
        check_numbers(values)
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
