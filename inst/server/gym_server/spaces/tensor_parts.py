"""Members of a space, and batches, as tensors; parts are named by JSON pointers.

The tensors of a batch have the sub-environments along their first axis; those of a member lack that
axis. Text is the exception: it has one text per sub-environment.

Sequence, Graph, OneOf and spaces that contain them have no fixed parts and are sent as JSON only.
The functions that take members apart and put them together are created once per space, together
with the names of all parts.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import (
    Box,
    Dict,
    Discrete,
    MultiBinary,
    MultiDiscrete,
    Space,
    Text,
    Tuple,
)

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
# Leads to a part of a member.
Path = tuple[str | int, ...]
# Adds the parts of a value to the given ones.
TakeApart = Callable[[Any, Parts], None]
# Removes a value's parts from the given ones, and returns the value.
PutTogether = Callable[[Parts, Rows], object]


def tensor_writer(space: Space, name: str, is_batch: bool) -> Callable[[Any, bool], Parts]:
    """Return a function that writes members, or batches, of a space as tensors.

    Its arguments are the member or batch, and whether to transpose the tensors. See
    ``travels_as_tensors()`` for the spaces that it supports.
    """
    take_apart = _take_apart(space, name, is_batch)

    def write(value: Any, by_column: bool = False) -> Parts:
        parts = Parts({}, {}, by_column)
        take_apart(value, parts)
        return parts

    return write


def tensor_reader(space: Space, name: str) -> Callable[[Parts, Rows], object]:
    """Return a function that reads a member, or a batch, of a space from tensors.

    It raises NotInSpace if a part is missing or unknown, has another dtype, shape or number of
    rows, or is out of bounds.
    """
    put_together = _put_together(space, name, ())

    def read(sent: Parts, rows: Rows = ONE) -> object:
        left = Parts(dict(sent.tensors), dict(sent.texts))
        value = put_together(left, rows)
        for unknown in (*left.tensors, *left.texts):
            if unknown == name or unknown.startswith(f"{name}/"):
                raise NotInSpace(space, unknown, "it has no such part")
        return value

    return read


def travels_as_tensors(space: Space) -> bool:
    """Return whether the members of a space can be sent as tensors."""
    if isinstance(space, (Tuple, Dict)):
        return all(travels_as_tensors(part) for _, part in keyed(space))
    return isinstance(space, (*ARRAYS, Text))


@singledispatch
def _take_apart(space: Space, name: str, is_batch: bool) -> TakeApart:
    raise TypeError(f"no tensors for {type(space).__name__}")


@singledispatch
def _put_together(space: Space, name: str, path: Path) -> PutTogether:
    """Return the function that reads a part of a value, given the path to that part."""

    def refuse(parts: Parts, rows: Rows) -> object:
        refusal = NotInSpace(space, name, "its members travel as JSON")
        refusal.path[:] = path
        raise refusal

    return refuse


@singledispatch
def tensor_shapes(space: Any, name: str) -> Shapes | None:
    """Return the dtype and shape of each tensor of a member; None if they vary."""
    if not isinstance(space, ARRAYS):
        return None
    try:
        return {name: (tensor_name(space.dtype), space.shape or ())}
    except KeyError:
        return None


def _part_name(name: str, key: object) -> str:
    """Return the name of a part: a JSON pointer."""
    return f"{name}/{str(key).replace('~', '~0').replace('/', '~1')}"


# Arrays -------------------------------------------------------------------------------------


@_take_apart.register(Box)
@_take_apart.register(MultiBinary)
@_take_apart.register(MultiDiscrete)
def _(space: Any, name: str, is_batch: bool) -> TakeApart:
    dtype = space.dtype

    def put(value: Any, parts: Parts) -> None:
        array = np.asarray(value)
        try:
            parts.tensors[name] = Tensor.of(array, parts.by_column)
        except KeyError:
            # The format has no name for the array's own dtype.
            parts.tensors[name] = Tensor.of(array.astype(dtype), parts.by_column)

    return put


@_take_apart.register
def _(space: Discrete, name: str, is_batch: bool) -> TakeApart:
    dtype = wide_dtype(space)

    def put(value: Any, parts: Parts) -> None:
        array = np.asarray(value if is_batch else int(value), dtype)
        parts.tensors[name] = Tensor.of(array)

    return put


@_put_together.register(Box)
@_put_together.register(MultiBinary)
@_put_together.register(MultiDiscrete)
def _(space: Any, name: str, path: Path) -> PutTogether:
    return _array_together(space, name, space.dtype, path)


@_put_together.register
def _(space: Discrete, name: str, path: Path) -> PutTogether:
    of_wide = _array_together(space, name, wide_dtype(space), path)
    # R has only 32-bit integers, and sends batches of them.
    of_short = _array_together(space, name, np.dtype(np.int32), path)
    may_be_short = wide_dtype(space) == np.int64

    def put_together(parts: Parts, rows: Rows) -> object:
        sent = parts.tensors.get(name) if may_be_short and rows.number is not None else None
        is_short = sent is not None and sent.dtype == "I32"
        array = (of_short if is_short else of_wide)(parts, rows)
        return array.astype(space.dtype, copy=False)[()]

    return put_together


def _array_together(
    space: Any, name: str, dtype: np.dtype, path: Path
) -> Callable[[Parts, Rows], np.ndarray]:
    wanted, bounds, of_one = tensor_name(dtype), bounds_of(space), space.shape or ()

    def put_together(parts: Parts, rows: Rows) -> np.ndarray:
        tensor = parts.tensors.pop(name, None)
        shape = of_one if rows.number is None else (rows.number, *of_one)
        if tensor is None or tensor.dtype != wanted or tensor.shape != shape:
            refusal = _misfit(space, name, tensor, f"{wanted} {list(shape)}", rows)
            refusal.path[:] = path
            raise refusal
        array = tensor.array()
        if bounds.hold(array):
            return array
        refusal = bounds.refusal(space, array)
        # The first step of the path is the sub-environment.
        at = 0 if rows.number is None else 1
        refusal.path[at:at] = path
        raise refusal

    return put_together


def _misfit(space: Space, name: str, sent: Tensor | None, wanted: str, rows: Rows) -> NotInSpace:
    """Return the error for a tensor that is missing, or has another dtype or shape."""
    if sent is None:
        return NotInSpace(space, None, f"there is no tensor {name!r}")
    reason = f"{wanted} is needed"
    is_row_missing = sent.shape[1:] == (space.shape or ()) and sent.shape[:1] != (rows.number,)
    if rows.number is not None and sent.shape and is_row_missing:
        reason = f"one action for each of {rows.whose} is needed, not {sent.shape[0]}"
    return NotInSpace(space, f"{sent.dtype} {list(sent.shape)}", reason)


# Text ---------------------------------------------------------------------------------------


@_take_apart.register
def _(space: Text, name: str, is_batch: bool) -> TakeApart:
    def put(value: Any, parts: Parts) -> None:
        if not is_batch:
            parts.texts[name] = encode(space, value)
            return
        for sub_env, text in enumerate(value):
            parts.texts[_part_name(name, sub_env)] = encode(space, text)

    return put


@_put_together.register
def _(space: Text, name: str, path: Path) -> PutTogether:
    def put_together(parts: Parts, rows: Rows) -> object:
        if rows.number is None:
            return _take_text(space, name, parts, path)
        return tuple(
            _take_text(space, _part_name(name, sub_env), parts, (sub_env, *path))
            for sub_env in range(rows.number)
        )

    return put_together


def _take_text(space: Text, name: str, parts: Parts, path: Path) -> object:
    try:
        text = parts.texts.pop(name, None)
        if text is None:
            raise NotInSpace(space, None, f"there is no text {name!r}")
        return decode(space, text)
    except NotInSpace as refusal:
        refusal.path[:0] = path
        raise


@tensor_shapes.register
def _(space: Discrete, name: str) -> Shapes | None:
    return {name: (tensor_name(wide_dtype(space)), ())}


# Tuple and Dict -----------------------------------------------------------------------------


@tensor_shapes.register(Tuple)
@tensor_shapes.register(Dict)
def _(space: Any, name: str) -> Shapes | None:
    shapes: Shapes = {}
    for key, part in keyed(space):
        found = tensor_shapes(part, _part_name(name, key))
        if found is None:
            return None
        shapes |= found
    return shapes


@_take_apart.register(Tuple)
@_take_apart.register(Dict)
def _(space: Any, name: str, is_batch: bool) -> TakeApart:
    takers = [
        (key, _take_apart(part, _part_name(name, key), is_batch)) for key, part in keyed(space)
    ]

    def take_all_apart(value: Any, parts: Parts) -> None:
        for key, take_apart in takers:
            take_apart(value[key], parts)

    return take_all_apart


@_put_together.register(Tuple)
@_put_together.register(Dict)
def _(space: Any, name: str, path: Path) -> PutTogether:
    steps = [
        _put_together(
            part, _part_name(name, key), (*path, key if isinstance(space, Tuple) else str(key))
        )
        for key, part in keyed(space)
    ]
    return lambda *how: from_parts(space, [put_together(*how) for put_together in steps])
