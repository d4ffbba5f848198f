"""Number the values of a countable space, for tables with a row per observation.

The order is that of R's ``space_index()``, but from 0: of several numbers, the last one changes
first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import singledispatch
from math import prod
from typing import Any

import numpy as np
from gymnasium.spaces import Dict, Discrete, MultiBinary, MultiDiscrete, Space, Tuple

# The errors of ``States.index`` for anything that is not in the space.
NOT_A_STATE = (ValueError, TypeError, KeyError, IndexError)


@dataclass(frozen=True)
class States:
    """The values of a space, numbered from 0.

    Attributes:
        count: the number of values.
        index: returns the number of a value, or raises one of ``NOT_A_STATE``.
    """

    count: int
    index: Callable[[Any], int]


@singledispatch
def states_of(space: Space) -> States | None:
    """Return the numbering of a space's values; None if they cannot be counted."""
    return None


def _digits(nvec: list[int], start: list[int]) -> States:
    def index(value: Any) -> int:
        digits = np.asarray(value).ravel().tolist()
        number = 0
        for digit, n, first in zip(digits, nvec, start, strict=True):
            beyond = int(digit) - first
            if not 0 <= beyond < n or beyond + first != digit:
                raise ValueError(value)
            number = number * n + beyond
        return number

    return States(prod(nvec), index)


@states_of.register
def _(space: Discrete) -> States:
    return _digits([int(space.n)], [int(space.start)])


@states_of.register
def _(space: MultiDiscrete) -> States:
    return _digits(space.nvec.ravel().tolist(), space.start.ravel().tolist())


@states_of.register
def _(space: MultiBinary) -> States:
    size = prod(space.shape)
    return _digits([2] * size, [0] * size)


@states_of.register
def _(space: Tuple) -> States | None:
    return _together(dict(enumerate(space.spaces)))


@states_of.register
def _(space: Dict) -> States | None:
    return _together(space.spaces)


def _together(spaces: dict[Any, Space]) -> States | None:
    parts = {key: states for key, space in spaces.items() if (states := states_of(space))}
    if len(parts) < len(spaces):
        return None

    def index(value: Any) -> int:
        number = 0
        for key, part in parts.items():
            number = number * part.count + part.index(value[key])
        return number

    return States(prod(part.count for part in parts.values()), index)
