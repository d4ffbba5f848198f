"""Action spaces for reading, with Boxes as wide as their dtype.

Gymnasium does not check the bounds of a Box in ``step()``. The environment decides what an action
outside of them does; most environments clip it.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict, Graph, OneOf, Sequence, Space, Tuple


class _WideBox(Box):
    """A Box with its dtype's limits as bounds, and the ``repr()`` of the original.

    Infinite bounds stay infinite, because only then is an infinity a member.
    """

    def __init__(self, space: Box) -> None:
        dtype: Any = space.dtype
        limits: Any = np.finfo(dtype) if dtype.kind == "f" else np.iinfo(dtype)
        low, high = space.low.copy(), space.high.copy()
        low[np.isfinite(low)] = limits.min
        high[np.isfinite(high)] = limits.max
        super().__init__(low, high, space.shape, dtype)
        self._narrow = space

    def __repr__(self) -> str:
        return repr(self._narrow)


def with_wide_boxes(space: Space) -> Any:
    """Return a copy of a space whose Boxes have the limits of their dtype as bounds."""
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
