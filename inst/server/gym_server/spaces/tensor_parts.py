"""Members of a space, and batches, as tensors; parts are named by JSON pointers.

The tensors of a batch have the sub-environments along their first axis; those of a member lack that
axis. Text is the exception: it has one text per sub-environment.

Sequence, Graph, OneOf and spaces that contain them have no fixed parts and are sent as JSON only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Dict, Discrete, Space, Text, Tuple

from gym_server.protocol.safetensors import Parts, Tensor, tensor_name
from gym_server.spaces.arrays import bounds_of
from gym_server.spaces.discrete import wide_dtype
from gym_server.spaces.kinds import NotInSpace, decode, encode
from gym_server.spaces.stacking import ARRAYS, from_parts, keyed


class Rows(NamedTuple):
    """The number of members in a batch.

    Attributes:
        number: the number; None for a single member instead of a batch.
        whose: names the sub-environments, to complete "for each of ...".
    """

    number: int | None = None
    whose: str = ""


ONE = Rows()

# The dtype and shape of tensors by name.
Shapes = dict[str, tuple[str, tuple[int, ...]]]


def tensor_writer(space: Space, name: str, is_batch: bool) -> Callable[[Any, bool], Parts]:
    """Return a function that writes members, or batches, of a space as tensors.

    Its arguments are the member or batch, and whether to transpose the tensors. See
    ``travels_as_tensors()`` for the spaces that it supports.
    """
    leaves = _leaves(space, name)

    def write(value: Any, by_column: bool = False) -> Parts:
        parts = Parts({}, {}, by_column)
        for leaf in leaves:
            part = value
            for key in leaf.keys:
                part = part[key]
            leaf.write(part, parts, is_batch)
        return parts

    return write


def tensor_reader(space: Space, name: str) -> Callable[[Parts, Rows], object]:
    """Return a function that reads a member, or a batch, of a space from tensors.

    It raises NotInSpace if a part is missing or unknown, has another dtype, shape or number of
    rows, or is out of bounds.
    """
    leaves = _leaves(space, name)

    def read(sent: Parts, rows: Rows = ONE) -> object:
        left = Parts(dict(sent.tensors), dict(sent.texts))
        value = _together(space, iter([leaf.read(left, rows) for leaf in leaves]))
        for unknown in (*left.tensors, *left.texts):
            if unknown == name or unknown.startswith(f"{name}/"):
                raise NotInSpace(space, unknown, "it has no such part")
        return value

    return read


def travels_as_tensors(space: Space) -> bool:
    """Return whether the members of a space can be sent as tensors."""
    return all(isinstance(leaf.space, (*ARRAYS, Text)) for leaf in _leaves(space, ""))


def tensor_shapes(space: Space, name: str, short: bool = False) -> Shapes | None:
    """Return the dtype and shape of each tensor of a member; None if they vary.

    Args:
        space: the space.
        name: the name of the tensor, or of the tensors of its parts.
        short: whether Discrete members are int32 where these can represent them.
    """
    leaves = _leaves(space, name)
    try:
        return {leaf.name: (leaf.dtype_name(short), leaf.shape) for leaf in leaves}
    except KeyError:
        return None


def _leaves(space: Space, name: str, keys: tuple = ()) -> list[_Leaf]:
    """Return the parts of a space that have no parts themselves."""
    if not isinstance(space, (Tuple, Dict)):
        return [_Leaf(space, name, keys)]
    return [
        leaf
        for key, part in keyed(space)
        for leaf in _leaves(part, _part_name(name, key), (*keys, key))
    ]


def _part_name(name: str, key: object) -> str:
    """Return the name of a part: a JSON pointer."""
    return f"{name}/{str(key).replace('~', '~0').replace('/', '~1')}"


def _together(space: Space, values: Iterator) -> object:
    """Return a member, or batch, made of the values of its leaves."""
    if not isinstance(space, (Tuple, Dict)):
        return next(values)
    return from_parts(space, [_together(part, values) for _, part in keyed(space)])


class _Leaf:
    """A part of a space that is one tensor or text.

    Attributes:
        space: the part's space.
        name: the tensor's or text's name.
        keys: lead from a member to the part.
        dtype: the tensor's dtype; that of objects, which has no tensors, for other spaces.
        shape: the tensor's shape, without rows.
    """

    def __init__(self, space: Any, name: str, keys: tuple) -> None:
        self.space = space
        self.name = name
        self.keys = keys
        self.shape: tuple[int, ...] = space.shape or ()
        self.dtype = np.dtype(object)
        if isinstance(space, ARRAYS):
            self.dtype = wide_dtype(space) if isinstance(space, Discrete) else space.dtype
            self._bounds = bounds_of(space)

    def dtype_name(self, short: bool) -> str:
        """Return the name of the tensor's dtype, see ``tensor_shapes()``."""
        # Without the smallest int32, which is R's NA.
        is_short = (
            short
            and isinstance(self.space, Discrete)
            and self._bounds.low > -(2**31)
            and self._bounds.high < 2**31
        )
        return _SHORT if is_short else tensor_name(self.dtype)

    def write(self, value: Any, parts: Parts, is_batch: bool) -> None:
        """Add the part of a member or batch to others."""
        if isinstance(self.space, Text):
            for row, text in enumerate(value) if is_batch else [(None, value)]:
                parts.texts[self._text_name(row)] = encode(self.space, text)
            return
        if isinstance(self.space, Discrete):
            array = np.asarray(value if is_batch else int(value), self.dtype)
        else:
            array = np.asarray(value)
        try:
            parts.tensors[self.name] = Tensor.of(array, parts.by_column)
        except KeyError:
            # The format has no name for the array's own dtype.
            parts.tensors[self.name] = Tensor.of(array.astype(self.dtype), parts.by_column)

    def read(self, parts: Parts, rows: Rows) -> object:
        """Remove the part from others, and return it."""
        try:
            if isinstance(self.space, ARRAYS):
                return self._read_tensor(parts.tensors.pop(self.name, None), rows)
            if not isinstance(self.space, Text):
                raise NotInSpace(self.space, self.name, "its members travel as JSON")
            if rows.number is None:
                return self._read_text(parts, None)
            return tuple(self._read_text(parts, row) for row in range(rows.number))
        except NotInSpace as refusal:
            # The first step of the path may be the sub-environment.
            at = 0 if rows.number is None or not refusal.path else 1
            refusal.path[at:at] = self.keys
            raise

    def _read_tensor(self, tensor: Tensor | None, rows: Rows) -> object:
        if tensor is None:
            raise NotInSpace(self.space, None, f"there is no tensor {self.name!r}")
        shape = self.shape if rows.number is None else (rows.number, *self.shape)
        wanted = tensor_name(self.dtype)
        is_discrete = isinstance(self.space, Discrete)
        is_short = is_discrete and tensor.dtype == _SHORT
        if tensor.shape != shape or (tensor.dtype != wanted and not is_short):
            reason = f"{wanted} {list(shape)} is needed"
            is_batch = rows.number is not None and len(tensor.shape) > 0
            if is_batch and tensor.shape[1:] == self.shape and tensor.shape != shape:
                reason = f"one action for each of {rows.whose} is needed, not {tensor.shape[0]}"
            raise NotInSpace(self.space, f"{tensor.dtype} {list(tensor.shape)}", reason)
        array = tensor.array()
        if not self._bounds.hold(array):
            raise self._bounds.refusal(self.space, array)
        return array.astype(self.space.dtype, copy=False)[()] if is_discrete else array

    def _text_name(self, row: int | None) -> str:
        return self.name if row is None else _part_name(self.name, row)

    def _read_text(self, parts: Parts, row: int | None) -> object:
        name = self._text_name(row)
        try:
            if name not in parts.texts:
                raise NotInSpace(self.space, None, f"there is no text {name!r}")
            return decode(self.space, parts.texts.pop(name))
        except NotInSpace as refusal:
            refusal.path[:] = [] if row is None else [row]
            raise


# Also accepted for Discrete members: R has only 32-bit integers.
_SHORT = "I32"
