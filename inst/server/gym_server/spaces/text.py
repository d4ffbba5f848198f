"""Text: strings over a set of characters."""

from __future__ import annotations

from gymnasium.spaces import Text

from gym_server.spaces.kinds import NotInSpace, decode, description, encode


@description.register
def _(space: Text) -> dict[str, object]:
    return {
        "name": "Text",
        "dtype": None,
        "min_length": space.min_length,
        "max_length": space.max_length,
        "characters": "".join(sorted(space.character_set)),
    }


@encode.register
def _(space: Text, value: object) -> object:
    if not isinstance(value, str):
        raise TypeError(f"a text should be a str, not {type(value).__name__}")
    return str(value)


@decode.register
def _(space: Text, value: object) -> object:
    if not isinstance(value, str) or not space.contains(value):
        raise NotInSpace(space, value)
    return value
