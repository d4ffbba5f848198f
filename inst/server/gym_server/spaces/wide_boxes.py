"""Spaces of the actions that are handed on, whose Boxes hold all that their dtype can.

Gymnasium does not check the bounds of a Box when an environment steps: each does with what lies
outside as it likes, and most clip it.
"""

from __future__ import annotations

import copy

import numpy as np
from gymnasium.spaces import Box, Dict, Graph, OneOf, Sequence, Space, Tuple


class _WideBox(Box):
    """A Box that reaches as far as its dtype, and looks like the one that it was made of.

    An infinite bound stays: only there an infinity is a member.
    """

    def __init__(self, space: Box) -> None:
        limits = np.finfo(space.dtype) if space.dtype.kind == "f" else np.iinfo(space.dtype)
        low, high = space.low.copy(), space.high.copy()
        low[np.isfinite(low)] = limits.min
        high[np.isfinite(high)] = limits.max
        super().__init__(low, high, space.shape, space.dtype)  # type: ignore[arg-type]
        self._narrow = space

    def __repr__(self) -> str:
        return repr(self._narrow)


def with_wide_boxes(space: Space) -> Space:
    """Return a space like another one whose Boxes reach as far as their dtype."""
    match space:
        case Box():
            return space if space.dtype.kind == "b" else _WideBox(space)
        case Tuple() | OneOf() | Dict() | Sequence() | Graph():
            wide = copy.copy(space)
            _widen_parts(wide)
            return wide
        case _:
            return space


def _widen_parts(space: Space) -> None:
    match space:
        case Tuple() | OneOf():
            space.spaces = tuple(map(with_wide_boxes, space.spaces))
        case Dict():
            space.spaces = {key: with_wide_boxes(part) for key, part in space.spaces.items()}
        case Sequence():
            space.feature_space = with_wide_boxes(space.feature_space)
        case Graph():
            space.node_space = with_wide_boxes(space.node_space)
            if space.edge_space is not None:
                space.edge_space = with_wide_boxes(space.edge_space)
