"""JSON lists as arrays of a space's dtype and shape; for Box, MultiDiscrete and MultiBinary."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, singledispatch
from typing import Any, Protocol

import numpy as np

from gym_server.json_values import NONFINITE
from gym_server.spaces.kinds import NotInSpace


class ArraySpace(Protocol):
    """A space whose members are arrays, or a batch of such members."""

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the arrays."""

    @property
    def dtype(self) -> np.dtype:
        """The dtype of the arrays."""


def is_number(value: object) -> bool:
    """Return whether a JSON value is a number; booleans are not."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def read_integer(value: Any) -> int:
    """Read an integer from a JSON number, else raise TypeError."""
    if not is_number(value) or value % 1 != 0:
        raise TypeError("not an integer")
    return int(value)


def read_bit(value: object) -> bool:
    """Read a bit from a JSON boolean, 0 or 1, else raise TypeError."""
    if not isinstance(value, (int, float)) or value not in (0, 1):
        raise TypeError("not a bit")
    return bool(value)


@cache
def reader_of(dtype: np.dtype) -> Callable[[object], object]:
    """Return the function that reads one array element of a dtype from JSON.

    It raises TypeError or OverflowError for what the dtype does not have.
    """
    if dtype.kind == "b":
        return read_bit
    if dtype.kind == "f":
        largest = float(np.finfo(dtype).max)

        def read_float(value: Any) -> float:
            if isinstance(value, str) and value in NONFINITE:
                return NONFINITE[value]
            if not is_number(value):
                raise TypeError("not a number")
            number = float(value)
            if abs(number) > largest and math.isfinite(number):
                raise OverflowError("out of the dtype's range")
            return number

        return read_float
    limits = np.iinfo(dtype)

    def read(value: object) -> int:
        number = read_integer(value)
        if not limits.min <= number <= limits.max:
            raise OverflowError("out of the dtype's range")
        return number

    return read


def as_number(value: object) -> object:
    """Convert true and false to 1 and 0, for Discrete and MultiDiscrete."""
    return int(value) if isinstance(value, bool) else value


def choice_reader_of(dtype: np.dtype) -> Callable[[object], object]:
    """Return the function that reads one element of a MultiDiscrete from JSON."""
    read = reader_of(dtype)
    return lambda value: read(as_number(value))


@dataclass(frozen=True)
class Bounds:
    """The smallest and the largest member, element by element."""

    low: Any
    high: Any

    def inside(self, array: np.ndarray) -> np.ndarray:
        """Return which elements are within the bounds; NaN is not."""
        within: np.ndarray = (array >= self.low) & (array <= self.high)
        return within

    def hold(self, array: np.ndarray) -> bool:
        """Return whether all elements are within the bounds."""
        if isinstance(self.low, int) and array.size:
            if array.size == 1:
                # NumPy takes ten times as long for one number.
                return bool(self.low <= array.item() <= self.high)
            # Two passes, without a temporary array.
            least, most = np.minimum.reduce(array, axis=None), np.maximum.reduce(array, axis=None)
            return bool(least >= self.low and most <= self.high)
        return bool(np.logical_and.reduce(self.inside(array), axis=None))

    def refusal(self, space: object, array: np.ndarray) -> NotInSpace:
        """Return the error, with the index, for the first element outside the bounds, or NaN."""
        first = tuple(int(index) for index in np.argwhere(~self.inside(array))[0])
        refusal = NotInSpace(space, array[first].item())
        refusal.path[:] = first
        return refusal


@singledispatch
def bounds_of(space: object) -> Bounds:
    """Return the bounds of a space of arrays. They apply to batches too."""
    raise TypeError(f"no bounds for {type(space).__name__}")


def read_array(
    space: ArraySpace, bounds: Bounds, read_element: Callable[[object], object], value: object
) -> np.ndarray:
    """Read a JSON value as an array of a space's dtype and shape.

    Args:
        space: the space.
        bounds: the bounds of its members.
        read_element: reads one element, or raises TypeError, ValueError or OverflowError.
        value: nested lists of the space's shape, a flat list with as many elements, or for the
            shape (1,) a single element.

    Raises:
        NotInSpace: the value does not fit; with the path to the first element that does not.
    """
    is_bare = space.shape == (1,) and not isinstance(value, list)
    nested = [value] if is_bare else value
    shape: tuple[int, ...] = ()
    try:
        elements = _each(space, read_element, nested, max(len(space.shape), 1))
        array = _array(elements, space.dtype)
        shape = array.shape
        if shape != space.shape and shape != (int(np.prod(space.shape)),):
            raise ValueError("another shape")
        member = array.reshape(space.shape)
        if not bounds.hold(member):
            raise bounds.refusal(space, member)
    except ValueError:
        # The lists are of different lengths, or of others than the space's.
        raise NotInSpace(space, value) from None
    except NotInSpace as refusal:
        if is_bare:
            refusal.path.clear()
        elif shape and shape != space.shape:
            # The client sent a flat list, so the path must be an index into it.
            index: tuple[Any, ...] = tuple(refusal.path)
            refusal.path[:] = [int(np.ravel_multi_index(index, space.shape))]
        raise
    return member


def _each(space: object, read_element: Callable, value: object, depth: int) -> object:
    """Read each element of nested lists."""
    if not isinstance(value, list) or depth == 0:
        try:
            return read_element(value)
        except (TypeError, ValueError, OverflowError):
            raise NotInSpace(space, value) from None
    items = []
    for index, item in enumerate(value):
        try:
            items.append(_each(space, read_element, item, depth - 1))
        except NotInSpace as refusal:
            refusal.path.insert(0, index)
            raise
    return items


def _array(elements: object, dtype: np.dtype) -> np.ndarray:
    if dtype.kind != "f":
        return np.array(elements, dtype=dtype)
    with np.errstate(under="ignore"):
        return np.array(elements, dtype=np.float64).astype(dtype)
