"""Box: numbers within bounds, of any dtype and shape."""

from __future__ import annotations

import math

import numpy as np
from gymnasium.spaces import Box

from gym_server.spaces.arrays import Bounds, bounds_of, read_array, reader_of
from gym_server.spaces.kinds import decode, description, encode

# Classic clients cannot read infinities; they use this number instead.
_INFINITIES = {math.inf: 1e100, -math.inf: -1e100}


@description.register
def _(space: Box) -> dict[str, object]:
    return {
        "name": "Box",
        "shape": list(space.shape),
        "dtype": space.dtype.name,
        "low": _flat(space.low),
        "high": _flat(space.high),
    }


def _flat(bounds: np.ndarray) -> list:
    return [_INFINITIES.get(bound, bound) for bound in bounds.ravel().tolist()]


@encode.register
def _(space: Box, value: object) -> object:
    return np.asarray(value).tolist()


class _BoxBounds(Bounds):
    """Bounds that every finite number is within.

    Gymnasium does not check the bounds of a Box in ``step()``. The environment decides what an
    action outside of them does; most environments clip it.
    """

    def inside(self, array: np.ndarray) -> np.ndarray:
        """Return which elements may be in an action; NaN may not, an infinity if it is a bound."""
        within: np.ndarray = np.isfinite(array) | super().inside(array)
        return within

    def hold(self, array: np.ndarray) -> bool:
        """Return whether all elements may be in an action."""
        is_finite = bool(np.logical_and.reduce(np.isfinite(array), axis=None))
        return is_finite or super().hold(array)


@bounds_of.register
def _(space: Box) -> Bounds:
    return _BoxBounds(space.low, space.high)


@decode.register
def _(space: Box, value: object) -> object:
    return read_array(space, bounds_of(space), reader_of(space.dtype), value)
