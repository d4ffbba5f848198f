"""Sequence: any number of members of one space."""

from __future__ import annotations

from typing import Any

from gymnasium.spaces import Sequence

from gym_server.spaces.kinds import NotInSpace, decode, decode_part, description, encode
from gym_server.spaces.stacking import stack, unstack


@description.register
def _(space: Sequence) -> dict[str, object]:
    return {
        "name": "Sequence",
        "dtype": None,
        "space": description(space.feature_space),
        "stack": bool(space.stack),
    }


@encode.register
def _(space: Sequence, value: Any) -> Any:
    members = unstack(space.feature_space, value) if space.stack else value
    return [encode(space.feature_space, member) for member in members]


@decode.register
def _(space: Sequence, value: object) -> object:
    if not isinstance(value, list):
        raise NotInSpace(space, value, "a list is needed")
    members = [decode_part(space.feature_space, item, index) for index, item in enumerate(value)]
    return stack(space.feature_space, members) if space.stack else tuple(members)
