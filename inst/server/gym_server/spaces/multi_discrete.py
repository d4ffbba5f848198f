"""MultiDiscrete: an array of integers, each with a start and a number of values of its own."""

from __future__ import annotations

import numpy as np
from gymnasium.spaces import MultiDiscrete

from gym_server.spaces.arrays import Bounds, read_array, reader_of
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
    return read_array(space, multi_discrete_bounds(space), reader_of(space.dtype), value)


def multi_discrete_bounds(space: MultiDiscrete) -> Bounds:
    """Return the smallest and the largest member."""
    # The largest fits the dtype where start + nvec does not.
    return Bounds(space.start, space.start + (space.nvec - 1))
