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


@bounds_of.register
def _(space: Box) -> Bounds:
    return Bounds(space.low, space.high)


@decode.register
def _(space: Box, value: object) -> object:
    return read_array(space, bounds_of(space), reader_of(space.dtype), value)
