"""JSON lists as arrays of a space's dtype and shape; for Box, MultiDiscrete and MultiBinary."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, singledispatch
from typing import Any, Protocol

import numpy as np

from gym_server.json_values import NONFINITE
from gym_server.spaces.kinds import NotInSpace


class ArraySpace(Protocol):
    """What is needed of a space whose members are arrays, or of a batch of such members."""

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the arrays."""

    @property
    def dtype(self) -> np.dtype:
        """Their dtype."""


def is_number(value: object) -> bool:
    """Tell whether a JSON value is a number; a boolean is none."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def read_integer(value: Any) -> int:
    """Return the integer that a JSON number stands for, else raise TypeError."""
    if not is_number(value) or value % 1 != 0:
        raise TypeError("not an integer")
    return int(value)


def read_bit(value: object) -> bool:
    """Return the bit that a JSON boolean, 0 or 1 stands for, else raise TypeError."""
    if not isinstance(value, (int, float)) or value not in (0, 1):
        raise TypeError("not a bit")
    return bool(value)


def _natural(value: object) -> int:
    number = read_integer(value)
    if number < 0:
        raise OverflowError("negative")
    return number


def _float(value: Any) -> float:
    if isinstance(value, str) and value in NONFINITE:
        return NONFINITE[value]
    if not is_number(value):
        raise TypeError("not a number")
    return float(value)


_READERS = {"f": _float, "i": read_integer, "u": _natural, "b": read_bit}


def reader_of(dtype: np.dtype) -> Callable[[object], object]:
    """Return what reads one element of an array of a dtype out of JSON."""
    return _READERS[dtype.kind]


def as_number(value: object) -> object:
    """Return true and false as 1 and 0, for Discrete and MultiDiscrete; others as they are."""
    return int(value) if isinstance(value, bool) else value


def choice_reader_of(dtype: np.dtype) -> Callable[[object], object]:
    """Return what reads one element of a MultiDiscrete of a dtype out of JSON."""
    read = reader_of(dtype)
    return lambda value: read(as_number(value))


@dataclass(frozen=True)
class Bounds:
    """The smallest and the largest member, element by element."""

    low: np.ndarray | int
    high: np.ndarray | int

    @cached_property
    def _same_for_all(self) -> tuple[Any, Any] | None:
        """The bounds as two numbers, where all elements have the same."""
        # What is derived from NumPy's arrays compares as it likes.
        if not {type(self.low), type(self.high)} <= {np.ndarray, int}:
            return None
        low, high = np.asarray(self.low), np.asarray(self.high)
        if not low.size or low.min() != low.max() or high.min() != high.max():
            return None
        return low.flat[0].item(), high.flat[0].item()

    def hold(self, array: np.ndarray) -> bool:
        """Tell whether all elements of an array lie inside; NaN does not."""
        same = self._same_for_all
        if same is None or not array.size:
            inside = (array >= self.low) & (array <= self.high)
            return bool(inside.all())
        low, high = same
        # Two passes without an array between them.
        least, most = np.minimum.reduce(array, axis=None), np.maximum.reduce(array, axis=None)
        return bool(least >= low and most <= high)


@singledispatch
def bounds_of(space: object) -> Bounds:
    """Return the smallest and the largest member of a space of arrays; batches have the same."""
    raise TypeError(f"no bounds for {type(space).__name__}")


def check_bounds(space: object, bounds: Bounds, array: np.ndarray) -> None:
    """Raise NotInSpace, with the index, for the first element that lies outside (or is NaN)."""
    if not bounds.hold(array):
        inside = (array >= bounds.low) & (array <= bounds.high)
        first = tuple(int(index) for index in np.argwhere(~inside)[0])
        refusal = NotInSpace(space, array[first].item())
        refusal.path[:] = first
        raise refusal


def read_array(
    space: ArraySpace, bounds: Bounds, read_element: Callable[[object], object], value: object
) -> np.ndarray:
    """Return a JSON value as an array of a space's dtype and shape.

    Args:
        space: the space.
        bounds: what its members lie between.
        read_element: reads one element, or raises TypeError, ValueError or OverflowError.
        value: nested lists of the space's shape, a flat list of as many elements, or for the
            shape (1,) a bare element.

    Raises:
        NotInSpace: with the path to the element that does not fit, when it is one element.
    """
    is_bare = space.shape == (1,) and not isinstance(value, list)
    nested = [value] if is_bare else value
    try:
        array = _array(space, read_element, nested)
    except (TypeError, ValueError, OverflowError):
        raise _refusal(space, read_element, value) from None
    try:
        check_bounds(space, bounds, array.reshape(space.shape))
    except NotInSpace as refusal:
        if is_bare:
            refusal.path.clear()
        elif array.shape != space.shape:
            # The client sent a flat list, and the path must lead to the element there.
            index: tuple[Any, ...] = tuple(refusal.path)
            refusal.path[:] = [int(np.ravel_multi_index(index, space.shape))]
        raise
    return array.reshape(space.shape)


def _array(space: ArraySpace, read_element: Callable, nested: object) -> np.ndarray:
    elements = _each(read_element, nested, max(len(space.shape), 1))
    to_array = _float_array if space.dtype.kind == "f" else _integer_array
    array = to_array(elements, space.dtype)
    if array.shape != space.shape and array.shape != (int(np.prod(space.shape)),):
        raise ValueError("another shape")
    return array


def _each(read_element: Callable, value: object, depth: int) -> object:
    if isinstance(value, list):
        if depth == 0:
            raise ValueError("nested too deeply")
        return [_each(read_element, item, depth - 1) for item in value]
    return read_element(value)


def _float_array(numbers: object, dtype: np.dtype) -> np.ndarray:
    doubles = np.array(numbers, dtype=np.float64)
    with np.errstate(over="ignore", under="ignore"):
        array = doubles.astype(dtype)
    # A number that the dtype cannot hold must not slip in as an infinity.
    if np.any(np.isinf(array) & np.isfinite(doubles)):
        raise OverflowError("out of the dtype's range")
    return array


def _integer_array(numbers: object, dtype: np.dtype) -> np.ndarray:
    # NumPy 1 wraps a number that a small dtype cannot hold, so the widest one comes first.
    wide = np.array(numbers, dtype=np.uint64 if dtype.kind == "u" else np.int64)
    array = wide.astype(dtype)
    if np.any(array != wide):
        raise OverflowError("out of the dtype's range")
    return array


def _refusal(space: ArraySpace, read_element: Callable, value: object) -> NotInSpace:
    """Return the refusal of the first bad element; of the whole value when each element is good."""
    to_array = _float_array if space.dtype.kind == "f" else _integer_array
    for path, element in _elements(value, len(space.shape), ()):
        try:
            to_array(read_element(element), space.dtype)
        except (TypeError, ValueError, OverflowError):
            refusal = NotInSpace(space, element)
            refusal.path[:] = path
            return refusal
    return NotInSpace(space, value)


def _elements(
    value: object, depth: int, path: tuple[int, ...]
) -> Iterator[tuple[tuple[int, ...], object]]:
    if isinstance(value, list) and depth > 0:
        for index, item in enumerate(value):
            yield from _elements(item, depth - 1, (*path, index))
    else:
        yield path, value
