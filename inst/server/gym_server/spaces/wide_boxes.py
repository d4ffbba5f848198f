"""Spaces for reading actions, with Boxes whose bounds are the limits of their dtype.

Gymnasium does not check the bounds of a Box when an environment steps. What happens to an action
outside of them is up to the environment; most clip it.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict, Graph, OneOf, Sequence, Space, Tuple


class _WideBox(Box):
    """A Box with the limits of its dtype as bounds, whose ``repr()`` is that of the original.

    An infinite bound stays infinite, because an infinity is a member only there.
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
