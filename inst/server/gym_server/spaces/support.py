"""Describe a space to clients, or refuse one that the protocol cannot describe."""

from __future__ import annotations

from collections.abc import Iterable

from gymnasium.spaces import Box, Dict, Graph, OneOf, Sequence, Space, Tuple

from gym_server.errors import GymServerError
from gym_server.spaces.kinds import brief_space, description

# How deeply a member's JSON may be nested. Python and JSON readers limit recursion, and a space
# that contains itself must be refused.
DEEPEST = 100


def describe(space: Space) -> dict[str, object]:
    """Return a space's name, dtype and constructor arguments as JSON values.

    Raises:
        GymServerError: ``unsupported_space`` if it cannot be described in full.
    """
    _check(space, space, 0)
    return description(space)


def _check(space: Space, whole: Space, depth: int) -> None:
    if description.dispatch(type(space)) is description.dispatch(object):
        raise _unsupported(
            brief_space(whole),
            f"spaces of type {type(space).__name__} are not supported",
            "supported are " + ", ".join(sorted(_supported())),
        )
    if depth + len(space.shape or ()) > DEEPEST:
        # Do not print it: its repr() recurses as deeply, and a destructor that runs there fails.
        raise _unsupported(type(whole).__name__, f"it is nested deeper than {DEEPEST} levels")
    if isinstance(space, Box) and space.dtype.kind == "f" and space.dtype.itemsize > 8:
        wide = f"its dtype {space.dtype.name} has more digits than can be sent"
        raise _unsupported(brief_space(whole), wide)
    if isinstance(space, Dict) and len(set(map(str, space.spaces))) < len(space.spaces):
        raise _unsupported(brief_space(whole), "two of its keys are the same as text")
    for part in parts_of(space):
        _check(part, whole, depth + (2 if isinstance(space, Graph) else 1))


def parts_of(space: Space) -> Iterable[Space]:
    """Return the spaces that a space is directly made of."""
    match space:
        case Dict():
            return space.spaces.values()
        case Tuple() | OneOf():
            return space.spaces
        case Sequence():
            return (space.feature_space,)
        case Graph():
            return (part for part in (space.node_space, space.edge_space) if part is not None)
        case _:
            return ()


def _supported() -> list[str]:
    return [kind.__name__ for kind in description.registry if kind is not object]


def _unsupported(space: str, reason: str, hint: str | None = None) -> GymServerError:
    return GymServerError(
        "unsupported_space",
        f"This server does not support the space {space}: {reason}",
        hint,
    )
