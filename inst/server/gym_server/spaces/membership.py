"""Check whether a value is a member of a space, or a description matches it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from gymnasium.spaces import Space

from gym_server.spaces.arrays import is_number
from gym_server.spaces.kinds import NotInSpace


def contains(
    space: Space,
    claim: dict,
    decode: Callable[[object], object],
    describe: Callable[[], dict],
) -> bool:
    """Answer a client's "contains" question.

    Args:
        space: the space.
        claim: ``{"value": ...}`` asks whether a JSON value represents a member. Anything else is a
            classic client's description, such as ``{"name": "Box", "shape": [4]}``, and asks
            whether all of it matches the space.
        decode: returns what a JSON value represents, or raises ``NotInSpace``.
        describe: returns the space's description.
    """
    if "value" not in claim:
        return _describes(claim, describe())
    try:
        # What was decoded may be outside the bounds of a Box.
        return bool(space.contains(decode(claim["value"])))
    except NotInSpace:
        return False


def _describes(claim: dict, space_info: dict) -> bool:
    """Return whether all of a classic client's description matches a space."""
    return all(
        name in space_info and _same(value, space_info[name]) for name, value in claim.items()
    )


def _same(claimed: Any, real: object) -> bool:
    if isinstance(real, dict):
        return (
            isinstance(claimed, dict)
            and claimed.keys() == real.keys()
            and all(_same(claimed[name], real[name]) for name in real)
        )
    if isinstance(real, list):
        # R's jsonlite writes a vector of length one as a scalar.
        claimed = claimed if isinstance(claimed, list) else [claimed]
        return len(claimed) == len(real) and all(map(_same, claimed, real))
    if isinstance(real, bool):
        return claimed is real
    if is_number(claimed) and isinstance(real, float):
        # R's jsonlite writes only 15 of up to 17 digits.
        return math.isclose(claimed, real, rel_tol=1e-12)
    return type(claimed) is not bool and bool(claimed == real)
