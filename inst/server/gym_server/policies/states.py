"""The number of an observation among all there can be, for tables with a row for each.

They are counted as R's ``space_index()`` counts them, but from 0: of several numbers the last one
changes first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import singledispatch
from math import prod
from typing import Any

import numpy as np
from gymnasium.spaces import Dict, Discrete, MultiBinary, MultiDiscrete, Space, Tuple


@dataclass(frozen=True)
class States:
    """The values of a space, numbered from 0.

    Attributes:
        count: how many there are.
        index: returns the number of one. It raises ``ValueError``, ``TypeError``, ``KeyError`` or
            ``IndexError`` for what is none of them.
        indices: returns the numbers of a batch.
    """

    count: int
    index: Callable[[Any], int]
    indices: Callable[[Any], np.ndarray]


@singledispatch
def states_of(space: Space) -> States | None:
    """Return how the values of a space are numbered; None where they cannot be counted."""
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

    def indices(batch: Any) -> np.ndarray:
        rows = np.asarray(batch)
        return np.array([index(row) for row in rows], dtype=np.intp)

    return States(prod(nvec), index, indices)


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
    parts = [states_of(part) for part in space.spaces]
    return _together(list(range(len(parts))), parts)


@states_of.register
def _(space: Dict) -> States | None:
    return _together(list(space.spaces), [states_of(part) for part in space.spaces.values()])


def _together(keys: list[Any], parts: list[States | None]) -> States | None:
    known = [part for part in parts if part is not None]
    if len(known) < len(parts):
        return None

    def index(value: Any) -> int:
        number = 0
        for key, part in zip(keys, known, strict=True):
            number = number * part.count + part.index(value[key])
        return number

    def indices(batch: Any) -> np.ndarray:
        numbers: Any = 0
        for key, part in zip(keys, known, strict=True):
            numbers = numbers * part.count + part.indices(batch[key])
        return np.asarray(numbers)

    return States(prod(part.count for part in known), index, indices)
