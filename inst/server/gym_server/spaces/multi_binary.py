"""MultiBinary: an array of bits."""

from __future__ import annotations

import numpy as np
from gymnasium.spaces import MultiBinary

from gym_server.spaces.arrays import Bounds, bounds_of, read_array, read_bit
from gym_server.spaces.kinds import decode, description, encode

_BITS = Bounds(0, 1)


@description.register
def _(space: MultiBinary) -> dict[str, object]:
    return {"name": "MultiBinary", "shape": list(space.shape), "dtype": space.dtype.name}


@encode.register
def _(space: MultiBinary, value: object) -> object:
    return np.asarray(value, dtype=space.dtype).tolist()


@bounds_of.register
def _(space: MultiBinary) -> Bounds:
    return _BITS


@decode.register
def _(space: MultiBinary, value: object) -> object:
    return read_array(space, _BITS, read_bit, value)
