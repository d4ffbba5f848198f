"""Members of a space as tensors: the parts of nested ones are named by JSON pointer.

Sequence, Graph and OneOf have no fixed parts and travel as JSON only, and so does a space that
holds one of them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import singledispatch

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

from gym_server.spaces.arrays import Bounds, check_bounds
from gym_server.spaces.kinds import NotInSpace, decode
from gym_server.spaces.multi_binary import BITS
from gym_server.spaces.multi_discrete import multi_discrete_bounds
from gym_server.tensors import Tensor, has_tensor


@dataclass(frozen=True)
class Parts:
    """A member in parts.

    Attributes:
        tensors: each part that is made of numbers, by its name.
        texts: each text, by its name.
    """

    tensors: dict[str, Tensor] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)


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
    for unknown in (*left.tensors, *left.texts):
        if unknown == name or unknown.startswith(f"{name}/"):
            raise NotInSpace(space, unknown, "it has no such part")
    return member


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


def _part_name(name: str, key: object) -> str:
    return f"{name}/{str(key).replace('~', '~0').replace('/', '~1')}"


def _put_part_together(space: Space, name: str, key: object, parts: Parts, step: str | int):
    try:
        return _put_together(space, _part_name(name, key), parts)
    except NotInSpace as refusal:
        refusal.path.insert(0, step)
        raise


def _take_array(space: Space, name: str, dtype: np.dtype, parts: Parts) -> np.ndarray:
    tensor = parts.tensors.pop(name, None)
    if tensor is None:
        raise NotInSpace(space, None, f"there is no tensor {name!r}")
    wanted = Tensor.of(np.empty(0, dtype)).dtype
    if (tensor.dtype, tensor.shape) != (wanted, space.shape):
        raise NotInSpace(
            space,
            f"{tensor.dtype} {list(tensor.shape)}",
            f"{wanted} {list(space.shape or ())} is needed",
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
def _(space: Space, name: str, value: object, parts: Parts) -> None:
    array = np.asarray(value)
    if not has_tensor(array.dtype):
        array = array.astype(space.dtype)
    parts.tensors[name] = Tensor.of(array)


@_put_together.register
def _(space: Box, name: str, parts: Parts) -> object:
    return _bounded(space, Bounds(space.low, space.high), name, parts)


@_put_together.register
def _(space: MultiDiscrete, name: str, parts: Parts) -> object:
    return _bounded(space, multi_discrete_bounds(space), name, parts)


@_put_together.register
def _(space: MultiBinary, name: str, parts: Parts) -> object:
    return _bounded(space, BITS, name, parts)


def _bounded(space: Space, bounds: Bounds, name: str, parts: Parts) -> np.ndarray:
    array = _take_array(space, name, space.dtype, parts)
    check_bounds(space, bounds, array)
    return array.astype(space.dtype, copy=False)


# Discrete -----------------------------------------------------------------------------------


@_take_apart.register
def _(space: Discrete, name: str, value: object, parts: Parts) -> None:
    parts.tensors[name] = Tensor.of(np.array(int(value), _wide(space)))  # type: ignore[call-overload]


@_put_together.register
def _(space: Discrete, name: str, parts: Parts) -> object:
    return decode(space, _take_array(space, name, _wide(space), parts).item())


def _wide(space: Discrete) -> np.dtype:
    return np.dtype(np.uint64 if space.dtype == np.uint64 else np.int64)


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
        _take_apart(part, _part_name(name, index), item, parts)


@_put_together.register
def _(space: Tuple, name: str, parts: Parts) -> object:
    return tuple(
        _put_part_together(part, name, index, parts, index)
        for index, part in enumerate(space.spaces)
    )


# Dict ---------------------------------------------------------------------------------------


@travels_as_tensors.register
def _(space: Dict) -> bool:
    return all(map(travels_as_tensors, space.spaces.values()))


@_take_apart.register
def _(space: Dict, name: str, value: dict, parts: Parts) -> None:
    for key, part in space.spaces.items():
        _take_apart(part, _part_name(name, key), value[key], parts)


@_put_together.register
def _(space: Dict, name: str, parts: Parts) -> object:
    return {
        key: _put_part_together(part, name, key, parts, str(key))
        for key, part in space.spaces.items()
    }
