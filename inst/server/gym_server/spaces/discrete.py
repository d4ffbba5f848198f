"""Discrete: integers from ``start``."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Discrete

from gym_server.spaces.arrays import Bounds, as_number, bounds_of, read_integer
from gym_server.spaces.kinds import NotInSpace, decode, description, encode


@description.register
def _(space: Discrete) -> dict[str, object]:
    return {
        "name": "Discrete",
        "n": int(space.n),
        "start": int(space.start),
        "dtype": space.dtype.name,
    }


@encode.register
def _(space: Discrete, value: Any) -> Any:
    return int(value)


@bounds_of.register
def _(space: Discrete) -> Bounds:
    # Python integers: NumPy compares an array with them in the array's dtype.
    return Bounds(int(space.start), int(space.start) + int(space.n) - 1)


def wide_dtype(space: Discrete) -> np.dtype:
    """Return the dtype of a Discrete space's tensors."""
    return np.dtype(np.uint64 if space.dtype == np.uint64 else np.int64)


@decode.register
def _(space: Discrete, value: object) -> object:
    try:
        number = read_integer(as_number(value))
    except (TypeError, OverflowError):
        raise NotInSpace(space, value) from None
    if not 0 <= number - int(space.start) < int(space.n):
        raise NotInSpace(space, value)
    return space.dtype.type(number)
