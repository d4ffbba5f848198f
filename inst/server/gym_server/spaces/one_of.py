"""OneOf: a member of one of several spaces, and the index of that space."""

from __future__ import annotations

import numpy as np
from gymnasium.spaces import OneOf

from gym_server.spaces.arrays import read_integer
from gym_server.spaces.kinds import NotInSpace, decode, decode_part, description, encode


@description.register
def _(space: OneOf) -> dict[str, object]:
    return {"name": "OneOf", "dtype": None, "spaces": [description(part) for part in space.spaces]}


@encode.register
def _(space: OneOf, value: tuple) -> object:
    index, member = value
    return [int(index), encode(space.spaces[index], member)]


@decode.register
def _(space: OneOf, value: object) -> object:
    if not isinstance(value, list) or len(value) != 2:
        raise NotInSpace(space, value, "a list of an index and a value is needed")
    try:
        index = read_integer(value[0])
    except (TypeError, OverflowError):
        index = -1
    if not 0 <= index < len(space.spaces):
        refusal = NotInSpace(space, value[0], f"it has {len(space.spaces)} spaces, from 0")
        refusal.path.append(0)
        raise refusal
    return np.int64(index), decode_part(space.spaces[index], value[1], 1)
