"""Members of a space as tensors: the parts of nested ones are named by JSON pointer.

Sequence, Graph and OneOf have no fixed parts and travel as JSON only, and so does a space that
holds one of them.
"""

from __future__ import annotations

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

from gym_server.protocol.safetensors import Parts, Tensor, has_tensor, tensor_name
from gym_server.spaces.arrays import ArraySpace, bounds_of, check_bounds
from gym_server.spaces.discrete import wide_dtype
from gym_server.spaces.kinds import NotInSpace, decode


def encode_tensors(space: Space, name: str, value: object) -> Parts:
    """Return a member of a space as tensors; see ``travels_as_tensors()``."""
    parts = Parts()
    _take_apart(space, name, value, parts)
    return parts


def decode_tensors(space: Space, name: str, sent: Parts) -> object:
    """Return the member of a space that some tensors are.

    Raises:
        NotInSpace: when they are none: a part too few or too many, another dtype or shape, or
            outside the bounds.
    """
    left = Parts(dict(sent.tensors), dict(sent.texts))
    member = _put_together(space, name, left)
    refuse_leftovers(space, name, left)
    return member


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
def _take_apart(space: Space, name: str, value: object, parts: Parts) -> None:
    raise TypeError(f"no tensors for {type(space).__name__}")


@singledispatch
def _put_together(space: Space, name: str, parts: Parts) -> object:
    raise NotInSpace(space, name, "its members travel as JSON")


def part_name(name: str, key: object) -> str:
    """Return the name of a part of what has a name: a JSON pointer."""
    return f"{name}/{str(key).replace('~', '~0').replace('/', '~1')}"


def put_part_together(
    space: Space, name: str, key: object, parts: Parts, step: str | int
) -> object:
    """Return a part of a member; a refusal names the step that leads to it."""
    try:
        return _put_together(space, part_name(name, key), parts)
    except NotInSpace as refusal:
        refusal.path.insert(0, step)
        raise


def take_array(
    space: object, name: str, dtype: np.dtype, shape: tuple[int, ...], parts: Parts
) -> np.ndarray:
    """Take the tensor of a name out of some parts; raise NotInSpace for another dtype or shape."""
    tensor = parts.tensors.pop(name, None)
    if tensor is None:
        raise NotInSpace(space, None, f"there is no tensor {name!r}")
    wanted = tensor_name(dtype)
    if (tensor.dtype, tensor.shape) != (wanted, shape):
        raise NotInSpace(
            space,
            f"{tensor.dtype} {list(tensor.shape)}",
            f"{wanted} {list(shape)} is needed",
        )
    return tensor.array()


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
def put_array(space: ArraySpace, name: str, value: object, parts: Parts) -> None:
    """Put an array of a space's numbers, of one member or of many, into some parts."""
    array = np.asarray(value)
    if not has_tensor(array.dtype):
        array = array.astype(space.dtype)
    parts.tensors[name] = Tensor.of(array)


@_put_together.register(Box)
@_put_together.register(MultiBinary)
@_put_together.register(MultiDiscrete)
def _(space: ArraySpace, name: str, parts: Parts) -> object:
    array = take_array(space, name, space.dtype, space.shape, parts)
    check_bounds(space, bounds_of(space), array)
    return array


# Discrete -----------------------------------------------------------------------------------


@_take_apart.register
def _(space: Discrete, name: str, value: Any, parts: Parts) -> None:
    parts.tensors[name] = Tensor.of(np.array(int(value), wide_dtype(space)))


@_put_together.register
def _(space: Discrete, name: str, parts: Parts) -> object:
    return decode(space, take_array(space, name, wide_dtype(space), (), parts).item())


# Text ---------------------------------------------------------------------------------------


@_take_apart.register
def _(space: Text, name: str, value: object, parts: Parts) -> None:
    if not isinstance(value, str):
        raise TypeError(f"a text should be a str, not {type(value).__name__}")
    parts.texts[name] = str(value)


@_put_together.register
def _(space: Text, name: str, parts: Parts) -> object:
    text = parts.texts.pop(name, None)
    if text is None:
        raise NotInSpace(space, None, f"there is no text {name!r}")
    return decode(space, text)


# Tuple --------------------------------------------------------------------------------------


@travels_as_tensors.register
def _(space: Tuple) -> bool:
    return all(map(travels_as_tensors, space.spaces))


@_take_apart.register
def _(space: Tuple, name: str, value: tuple, parts: Parts) -> None:
    for index, (part, item) in enumerate(zip(space.spaces, value, strict=True)):
        _take_apart(part, part_name(name, index), item, parts)


@_put_together.register
def _(space: Tuple, name: str, parts: Parts) -> object:
    return tuple(
        put_part_together(part, name, index, parts, index)
        for index, part in enumerate(space.spaces)
    )


# Dict ---------------------------------------------------------------------------------------


@travels_as_tensors.register
def _(space: Dict) -> bool:
    return all(map(travels_as_tensors, space.spaces.values()))


@_take_apart.register
def _(space: Dict, name: str, value: dict, parts: Parts) -> None:
    for key, part in space.spaces.items():
        _take_apart(part, part_name(name, key), value[key], parts)


@_put_together.register
def _(space: Dict, name: str, parts: Parts) -> object:
    return {
        key: put_part_together(part, name, key, parts, str(key))
        for key, part in space.spaces.items()
    }
