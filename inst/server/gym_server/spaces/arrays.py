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
    """Return the function that reads one array element of a dtype from JSON."""
    return _READERS[dtype.kind]


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

    low: np.ndarray | int
    high: np.ndarray | int

    @cached_property
    def _same_for_all(self) -> tuple[Any, Any] | None:
        """The bounds as two numbers, if all elements have the same bounds."""
        # Subclasses of ndarray may compare differently.
        if not {type(self.low), type(self.high)} <= {np.ndarray, int}:
            return None
        low, high = np.asarray(self.low), np.asarray(self.high)
        if not low.size or low.min() != low.max() or high.min() != high.max():
            return None
        return low.flat[0].item(), high.flat[0].item()

    def hold(self, array: np.ndarray) -> bool:
        """Return whether all elements are within the bounds; NaN is not."""
        same = self._same_for_all
        if same is None or not array.size:
            inside = (array >= self.low) & (array <= self.high)
            return bool(inside.all())
        low, high = same
        # Two passes, without a temporary array.
        least, most = np.minimum.reduce(array, axis=None), np.maximum.reduce(array, axis=None)
        return bool(least >= low and most <= high)

    def refusal(self, space: object, array: np.ndarray) -> NotInSpace:
        """Return the error, with the index, for the first element outside the bounds, or NaN."""
        inside = (array >= self.low) & (array <= self.high)
        first = tuple(int(index) for index in np.argwhere(~inside)[0])
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
    try:
        array = _array(space, read_element, nested)
    except (TypeError, ValueError, OverflowError):
        raise _refusal(space, read_element, value) from None
    member = array.reshape(space.shape)
    if bounds.hold(member):
        return member
    refusal = bounds.refusal(space, member)
    if is_bare:
        refusal.path.clear()
    elif array.shape != space.shape:
        # The client sent a flat list, so the path must be an index into it.
        index: tuple[Any, ...] = tuple(refusal.path)
        refusal.path[:] = [int(np.ravel_multi_index(index, space.shape))]
    raise refusal


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
    # Numbers outside the dtype's range must not become infinite.
    if np.any(np.isinf(array) & np.isfinite(doubles)):
        raise OverflowError("out of the dtype's range")
    return array


def _integer_array(numbers: object, dtype: np.dtype) -> np.ndarray:
    # NumPy 1 wraps numbers outside a small dtype's range, so read into the widest first.
    wide = np.array(numbers, dtype=np.uint64 if dtype.kind == "u" else np.int64)
    array = wide.astype(dtype)
    if np.any(array != wide):
        raise OverflowError("out of the dtype's range")
    return array


def _refusal(space: ArraySpace, read_element: Callable, value: object) -> NotInSpace:
    """Return the error for the first bad element, or for the whole value if none is bad."""
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
