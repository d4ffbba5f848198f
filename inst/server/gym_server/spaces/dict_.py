"""Dict: members by name, each with its own space."""

from __future__ import annotations

from typing import Any

from gymnasium.spaces import Dict

from gym_server.json_values import brief
from gym_server.spaces.kinds import NotInSpace, decode, decode_part, description, encode


@description.register
def _(space: Dict) -> dict[str, object]:
    return {
        "name": "Dict",
        "dtype": None,
        # A list, because not every JSON reader keeps the order of an object.
        "spaces": [
            {"key": str(key), "space": description(part)} for key, part in space.spaces.items()
        ],
    }


@encode.register
def _(space: Dict, value: Any) -> Any:
    return {str(key): encode(part, value[key]) for key, part in space.spaces.items()}


@decode.register
def _(space: Dict, value: object) -> object:
    if value == [] and not space.spaces:
        # R's empty list and empty object look the same.
        return {}
    if not isinstance(value, dict):
        raise NotInSpace(space, value, "an object is needed")
    by_text = {str(key): key for key in space.spaces}
    # In order, so that the same value always gets the same words.
    for text in by_text:
        if text not in value:
            raise NotInSpace(space, value, f"{brief(text)} is missing")
    for text in value:
        if text not in by_text:
            raise NotInSpace(space, value, f"{brief(text)} is not one of its keys")
    return {key: decode_part(space.spaces[key], value[text], text) for text, key in by_text.items()}
