"""The functions that every kind of space registers, and the error for non-members."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial, singledispatch
from typing import Any

from gymnasium.spaces import Space

from gym_server.json_values import brief, shortened
from gym_server.spaces.stacking import unstack


class NotInSpace(Exception):  # noqa: N818 - it answers a question as often as it is an error
    """A value is not a member of a space."""

    def __init__(self, space: object, value: object, reason: str = "") -> None:
        """Keep the parts of the message.

        Args:
            space: the space, which may be a part of the client's space.
            value: the part of the client's value that is wrong.
            reason: what is wrong, if space and value do not show it.
        """
        super().__init__(space, value, reason)
        # The keys, and indices from 0, that lead from the client's value to this part.
        self.path: list[str | int] = []

    def __str__(self) -> str:
        space, value, reason = self.args
        where = f" at {_written(self.path)}" if self.path else ""
        because = f": {reason}" if reason else ""
        return f"{brief(value)}{where} is not in {brief_space(space)}{because}"


def _written(path: list[str | int]) -> str:
    """Return a path in R's notation, ``$position[2]``, but with indices from 0."""
    return "".join(f"[{step}]" if isinstance(step, int) else _named(step) for step in path)


def _named(key: str) -> str:
    return f"${key}" if re.fullmatch(r"[A-Za-z.][\w.]*", key) else f"$`{key}`"


def brief_space(space: object, width: int = 120) -> str:
    """Return a space as short text, for error messages."""
    try:
        text = repr(space)
    except Exception:
        # A custom space may raise anything, and a space may contain itself.
        text = type(space).__name__
    return shortened(text, width)


@singledispatch
def description(space: Space) -> dict[str, object]:
    """Return a space's name, dtype and constructor arguments as JSON values."""
    raise TypeError(f"no description for {type(space).__name__}")


@singledispatch
def encode(space: Space, value: Any) -> Any:
    """Encode a member of a space as JSON values (floats may still be non-finite)."""
    raise TypeError(f"no encoding for {type(space).__name__}")


def encode_members(space: Any, batch: Any) -> list:
    """Encode a batch as a list of JSON values, one per member."""
    return [encode(space, member) for member in unstack(space, batch)]


@singledispatch
def decode(space: Space, value: object) -> object:
    """Decode a JSON value to a member of a space, in the space's dtype.

    Numbers of a Box may be outside of its bounds, see ``box.py``.

    Raises:
        NotInSpace: the value does not represent a member.
    """
    raise TypeError(f"no decoding for {type(space).__name__}")


def json_reader(space: Space) -> Callable[[object], object]:
    """Return ``decode()`` for one space, which saves the dispatch for each member."""
    return partial(decode.dispatch(type(space)), space)


def decode_part(space: Space, value: object, *path: str | int) -> object:
    """Decode a part of a value; errors name its path."""
    try:
        return decode(space, value)
    except NotInSpace as refusal:
        refusal.path[:0] = path
        raise
