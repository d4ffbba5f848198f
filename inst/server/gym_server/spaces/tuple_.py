"""Tuple: a fixed number of members, each with its own space."""

from __future__ import annotations

from typing import Any

from gymnasium.spaces import Tuple

from gym_server.spaces.kinds import NotInSpace, decode, decode_part, description, encode


@description.register
def _(space: Tuple) -> dict[str, object]:
    return {"name": "Tuple", "dtype": None, "spaces": [description(part) for part in space.spaces]}


@encode.register
def _(space: Tuple, value: Any) -> Any:
    return [encode(part, item) for part, item in zip(space.spaces, value, strict=True)]


@decode.register
def _(space: Tuple, value: object) -> object:
    if not isinstance(value, list) or len(value) != len(space.spaces):
        raise NotInSpace(space, value, f"a list of {len(space.spaces)} is needed")
    return tuple(
        decode_part(part, item, index)
        for index, (part, item) in enumerate(zip(space.spaces, value, strict=True))
    )
