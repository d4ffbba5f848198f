"""The functions that every kind of space registers, and the error of a value that is no member."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial, singledispatch
from typing import Any

from gymnasium.spaces import Space

from gym_server.json_values import brief


class NotInSpace(Exception):  # noqa: N818 - it answers a question as often as it is an error
    """A value that is no member of a space."""

    def __init__(self, space: object, value: object, reason: str = "") -> None:
        """Keep what the message says.

        Args:
            space: the space that the value is not in; it may be a part of the client's space.
            value: the part of the client's value that is wrong.
            reason: what is wrong with it, where space and value do not show it.
        """
        super().__init__(space, value, reason)
        # The keys, and the indices from 0, that lead from the client's value to this part.
        self.path: list[str | int] = []

    def __str__(self) -> str:
        space, value, reason = self.args
        where = f" at {_written(self.path)}" if self.path else ""
        because = f": {reason}" if reason else ""
        return f"{brief(value)}{where} is not in {brief_space(space)}{because}"


def _written(path: list[str | int]) -> str:
    """Return a path as R writes it, ``$position[2]``, with indices that begin at 0."""
    return "".join(f"[{step}]" if isinstance(step, int) else _named(step) for step in path)


def _named(key: str) -> str:
    return f"${key}" if re.fullmatch(r"[A-Za-z.][\w.]*", key) else f"$`{key}`"


def brief_space(space: object, width: int = 120) -> str:
    """Return a space as short text, for error messages."""
    try:
        text = repr(space)
    except Exception:
        # An environment's own kind of space may raise anything; a space may contain itself.
        text = type(space).__name__
    return text if len(text) <= width else text[: width - 3] + "..."


@singledispatch
def description(space: Space) -> dict[str, object]:
    """Return a space's name, dtype and all that its constructor needs, as JSON values."""
    raise TypeError(f"no description for {type(space).__name__}")


@singledispatch
def encode(space: Space, value: Any) -> Any:
    """Return a member of a space as JSON values (floats may still be non-finite)."""
    raise TypeError(f"no encoding for {type(space).__name__}")


@singledispatch
def decode(space: Space, value: object) -> object:
    """Return the member of a space that a JSON value stands for, in the space's dtype.

    Raises:
        NotInSpace: when the value stands for none.
    """
    raise TypeError(f"no decoding for {type(space).__name__}")


def json_reader(space: Space) -> Callable[[object], object]:
    """Return ``decode()`` for one space: its kind is not looked up for each member."""
    return partial(decode.dispatch(type(space)), space)


def decode_part(space: Space, value: object, *path: str | int) -> object:
    """Decode what lies at a path inside a value; a refusal names the path."""
    try:
        return decode(space, value)
    except NotInSpace as refusal:
        refusal.path[:0] = path
        raise
