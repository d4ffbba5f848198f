"""Members of a space as tensors: the parts of nested ones are named by JSON pointer.

Sequence, Graph and OneOf have no fixed parts and travel as JSON only, and so does a space that
holds one of them.  What takes a space's members apart and puts them together is made once for a
space, with the names of all its parts.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch
from typing import Any

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

from gym_server.protocol.safetensors import Parts, Tensor, has_tensor, native_dtype, tensor_name
from gym_server.spaces.arrays import ArraySpace, bounds_of, check_bounds
from gym_server.spaces.discrete import wide_dtype
from gym_server.spaces.kinds import NotInSpace, decode

# Puts the parts of a value into others.
TakeApart = Callable[[Any, Parts], None]
# Takes a member's parts out of others, and returns the member.
PutTogether = Callable[[Parts], object]


def tensor_writer(space: Space, name: str) -> Callable[[Any, bool], Parts]:
    """Return what returns a member of a space as tensors of a name; see ``travels_as_tensors()``.

    It is given the member, and whether the tensors are wanted by column.
    """
    take_apart = _take_apart(space, name)

    def write(value: Any, by_column: bool = False) -> Parts:
        parts = Parts({}, {}, by_column)
        take_apart(value, parts)
        return parts

    return write


def tensor_reader(space: Space, name: str) -> Callable[[Parts], object]:
    """Return what returns the member of a space that tensors of a name are.

    It raises NotInSpace when they are none: a part too few or too many, another dtype or shape, or
    outside the bounds.
    """
    put_together = _put_together(space, name)

    def read(sent: Parts) -> object:
        left = Parts(dict(sent.tensors), dict(sent.texts))
        member = put_together(left)
        refuse_leftovers(space, name, left)
        return member

    return read


def refuse_leftovers(space: Space, name: str, left: Parts) -> None:
    """Raise NotInSpace for a part that was sent and that the space does not have."""
    for unknown in (*left.tensors, *left.texts):
        if unknown == name or unknown.startswith(f"{name}/"):
            raise NotInSpace(space, unknown, "it has no such part")


@singledispatch
def travels_as_tensors(space: Space) -> bool:
    """Tell whether the members of a space may travel as tensors."""
    return False


@singledispatch
def _take_apart(space: Space, name: str) -> TakeApart:
    raise TypeError(f"no tensors for {type(space).__name__}")


@singledispatch
def _put_together(space: Space, name: str) -> PutTogether:
    def refuse(parts: Parts) -> object:
        raise NotInSpace(space, name, "its members travel as JSON")

    return refuse


def part_name(name: str, key: object) -> str:
    """Return the name of a part of what has a name: a JSON pointer."""
    return f"{name}/{str(key).replace('~', '~0').replace('/', '~1')}"


def _part_together(space: Space, name: str, key: object, step: str | int) -> PutTogether:
    """Return what puts a part of a member together; a refusal names the step that leads to it."""
    put_together = _put_together(space, part_name(name, key))

    def put_part_together(parts: Parts) -> object:
        try:
            return put_together(parts)
        except NotInSpace as refusal:
            refusal.path.insert(0, step)
            raise

    return put_part_together


def array_taker(
    space: object, name: str, dtype: np.dtype
) -> Callable[[Parts, tuple[int, ...]], np.ndarray]:
    """Return what takes the tensor of a name and a shape out of some parts, as an array of its own.

    It raises NotInSpace for another dtype or shape.
    """
    wanted = tensor_name(dtype)
    stored, native = native_dtype(wanted)

    def take(parts: Parts, shape: tuple[int, ...]) -> np.ndarray:
        tensor = parts.tensors.pop(name, None)
        if tensor is None:
            raise NotInSpace(space, None, f"there is no tensor {name!r}")
        if tensor.dtype != wanted or tensor.shape != shape:
            raise NotInSpace(
                space,
                f"{tensor.dtype} {list(tensor.shape)}",
                f"{wanted} {list(shape)} is needed",
            )
        return np.frombuffer(tensor.data, stored).reshape(shape).astype(native)

    return take


# Arrays -------------------------------------------------------------------------------------


@travels_as_tensors.register(Box)
@travels_as_tensors.register(Discrete)
@travels_as_tensors.register(MultiBinary)
@travels_as_tensors.register(MultiDiscrete)
@travels_as_tensors.register(Text)
def _(space: Space) -> bool:
    return True


@_take_apart.register(Box)
@_take_apart.register(MultiBinary)
@_take_apart.register(MultiDiscrete)
def array_putter(space: ArraySpace, name: str) -> TakeApart:
    """Return what puts an array of a space's numbers, of one member or of many, into some parts."""
    dtype = space.dtype

    def put(value: Any, parts: Parts) -> None:
        array = np.asarray(value)
        if not has_tensor(array.dtype):
            array = array.astype(dtype)
        parts.tensors[name] = Tensor.of(array, parts.by_column)

    return put


@_put_together.register(Box)
@_put_together.register(MultiBinary)
@_put_together.register(MultiDiscrete)
def _(space: ArraySpace, name: str) -> PutTogether:
    take, bounds, shape = array_taker(space, name, space.dtype), bounds_of(space), space.shape

    def put_together(parts: Parts) -> object:
        array = take(parts, shape)
        check_bounds(space, bounds, array)
        return array

    return put_together


# Discrete -----------------------------------------------------------------------------------


@_take_apart.register
def _(space: Discrete, name: str) -> TakeApart:
    dtype = wide_dtype(space)

    def put(value: Any, parts: Parts) -> None:
        parts.tensors[name] = Tensor.of(np.array(int(value), dtype))

    return put


@_put_together.register
def _(space: Discrete, name: str) -> PutTogether:
    take = array_taker(space, name, wide_dtype(space))
    return lambda parts: decode(space, take(parts, ()).item())


# Text ---------------------------------------------------------------------------------------


@_take_apart.register
def _(space: Text, name: str) -> TakeApart:
    def put(value: Any, parts: Parts) -> None:
        if not isinstance(value, str):
            raise TypeError(f"a text should be a str, not {type(value).__name__}")
        parts.texts[name] = str(value)

    return put


@_put_together.register
def _(space: Text, name: str) -> PutTogether:
    return lambda parts: take_text(space, name, parts)


def take_text(space: Text, name: str, parts: Parts) -> object:
    """Take the text of a name out of some parts."""
    text = parts.texts.pop(name, None)
    if text is None:
        raise NotInSpace(space, None, f"there is no text {name!r}")
    return decode(space, text)


# Tuple --------------------------------------------------------------------------------------


@travels_as_tensors.register
def _(space: Tuple) -> bool:
    return all(map(travels_as_tensors, space.spaces))


@_take_apart.register
def _(space: Tuple, name: str) -> TakeApart:
    return tuple_taker(
        [_take_apart(part, part_name(name, i)) for i, part in enumerate(space.spaces)]
    )


def tuple_taker(take_apart: list[TakeApart]) -> TakeApart:
    """Return what takes a tuple apart, given what takes its parts apart."""

    def take_all_apart(value: Any, parts: Parts) -> None:
        for take, item in zip(take_apart, value, strict=True):
            take(item, parts)

    return take_all_apart


@_put_together.register
def _(space: Tuple, name: str) -> PutTogether:
    parts_of = [_part_together(part, name, i, i) for i, part in enumerate(space.spaces)]
    return lambda parts: tuple([put_together(parts) for put_together in parts_of])


# Dict ---------------------------------------------------------------------------------------


@travels_as_tensors.register
def _(space: Dict) -> bool:
    return all(map(travels_as_tensors, space.spaces.values()))


@_take_apart.register
def _(space: Dict, name: str) -> TakeApart:
    return dict_taker(
        {key: _take_apart(part, part_name(name, key)) for key, part in space.spaces.items()}
    )


def dict_taker(take_apart: dict[Any, TakeApart]) -> TakeApart:
    """Return what takes a dict apart, given what takes its parts apart."""

    def take_all_apart(value: Any, parts: Parts) -> None:
        for key, take in take_apart.items():
            take(value[key], parts)

    return take_all_apart


@_put_together.register
def _(space: Dict, name: str) -> PutTogether:
    parts_of = {
        key: _part_together(part, name, key, str(key)) for key, part in space.spaces.items()
    }
    return lambda parts: {key: put_together(parts) for key, put_together in parts_of.items()}
