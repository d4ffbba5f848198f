"""Discrete: integers from ``start``."""

from __future__ import annotations

from gymnasium.spaces import Discrete

from gym_server.spaces.arrays import read_integer
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
def _(space: Discrete, value: object) -> object:
    return int(value)  # type: ignore[call-overload]


@decode.register
def _(space: Discrete, value: object) -> object:
    try:
        number = read_integer(value)
    except (TypeError, OverflowError):
        raise NotInSpace(space, value) from None
    if not 0 <= number - int(space.start) < int(space.n):
        raise NotInSpace(space, value)
    return space.dtype.type(number)
