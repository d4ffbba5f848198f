"""MultiDiscrete: an array of integers, each with its own start and number of values."""

from __future__ import annotations

import numpy as np
from gymnasium.spaces import MultiDiscrete

from gym_server.spaces.arrays import Bounds, bounds_of, choice_reader_of, read_array
from gym_server.spaces.kinds import decode, description, encode


@description.register
def _(space: MultiDiscrete) -> dict[str, object]:
    return {
        "name": "MultiDiscrete",
        "shape": list(space.shape),
        "dtype": space.dtype.name,
        "nvec": space.nvec.ravel().tolist(),
        "start": space.start.ravel().tolist(),
    }


@encode.register
def _(space: MultiDiscrete, value: object) -> object:
    return np.asarray(value).tolist()


@decode.register
def _(space: MultiDiscrete, value: object) -> object:
    return read_array(space, bounds_of(space), choice_reader_of(space.dtype), value)


@bounds_of.register
def _(space: MultiDiscrete) -> Bounds:
    # start + nvec may exceed the dtype where the largest value does not.
    return Bounds(space.start, space.start + (space.nvec - 1))
