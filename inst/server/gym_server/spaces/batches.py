"""Batches of members of a space, one for each sub-environment, as in Gymnasium's vector classes.

Arrays have the sub-environments along their first axis, Tuples and Dicts are batched part by part,
and Text, Sequence, Graph and OneOf have one entry for each sub-environment.  Nothing here loops
over the sub-environments of an array.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, MultiDiscrete, Space, Text, Tuple

from gym_server.protocol.safetensors import Parts, Tensor
from gym_server.spaces.arrays import (
    ArraySpace,
    bounds_of,
    check_bounds,
    choice_reader_of,
    read_array,
    read_bit,
    reader_of,
)
from gym_server.spaces.discrete import wide_dtype
from gym_server.spaces.kinds import NotInSpace, decode_part, encode
from gym_server.spaces.stacking import stack, unstack
from gym_server.spaces.tensor_parts import (
    part_name,
    put_array,
    put_part_together,
    refuse_leftovers,
    take_array,
)

_ARRAYS = (Box, Discrete, MultiBinary, MultiDiscrete)


@singledispatch
def encode_batch(space: Space, batch: Any) -> Any:
    """Return a batch of members of a space as JSON values (floats may still be non-finite)."""
    return [encode(space, member) for member in batch]


@encode_batch.register
def _(space: MultiBinary, batch: object) -> object:
    return np.asarray(batch, dtype=space.dtype).tolist()


@encode_batch.register(Box)
@encode_batch.register(Discrete)
@encode_batch.register(MultiDiscrete)
def _(space: Space, batch: object) -> object:
    return np.asarray(batch).tolist()


@encode_batch.register
def _(space: Tuple, batch: tuple) -> object:
    return [encode_batch(part, items) for part, items in zip(space.spaces, batch, strict=True)]


@encode_batch.register
def _(space: Dict, batch: dict) -> object:
    return {str(key): encode_batch(part, batch[key]) for key, part in space.spaces.items()}


def encode_sub_envs(space: Space, batch: object) -> list:
    """Return a batch as a list of JSON values, as ``decode_sub_envs()`` reads it."""
    return [encode(space, member) for member in unstack(space, batch)]


def decode_sub_envs(space: Space, value: object, num_envs: int, whose: str) -> object:
    """Return the batch that a list of JSON values stands for, one for each sub-environment.

    Args:
        space: of one sub-environment.
        value: the list.
        num_envs: how many sub-environments there are.
        whose: names the sub-environments where the number is wrong, in words that follow "for each
            of".

    Raises:
        NotInSpace: for a wrong number of sub-environments; for a value that is no member, with the
            sub-environment (from 0) as the first step of its path.
    """
    if not isinstance(value, list) or len(value) != num_envs:
        found = f", not {len(value)}" if isinstance(value, list) else ", as a list"
        raise NotInSpace(space, value, f"one action for each of {whose} is needed{found}")
    if isinstance(space, _ARRAYS):
        try:
            return _all_at_once(space, value)
        except (TypeError, ValueError, OverflowError, NotInSpace):
            # Some values may be written in another way that is allowed; else the refusal must name
            # the sub-environment. So decode them one by one.
            pass
    return stack(space, [decode_part(space, item, sub_env) for sub_env, item in enumerate(value)])


class _Batched(NamedTuple):
    """As much of a batched space as ``read_array()`` needs."""

    shape: tuple[int, ...]
    dtype: np.dtype


def _all_at_once(space: Any, value: list) -> np.ndarray:
    batched = _Batched((len(value), *space.shape), space.dtype)
    if not isinstance(space, Discrete):
        reader = _reader_of(space)
        return read_array(batched, bounds_of(space), reader, value)
    if not set(map(type, value)) <= {int, bool}:
        raise TypeError("not only integers")
    array = np.array(value, dtype=wide_dtype(space))
    check_bounds(space, bounds_of(space), array)
    return array.astype(space.dtype)


def _reader_of(space: Any) -> Callable[[object], object]:
    match space:
        case MultiBinary():
            return read_bit
        case MultiDiscrete():
            return choice_reader_of(space.dtype)
        case _:
            return reader_of(space.dtype)


# Tensors ------------------------------------------------------------------------------------


def encode_batch_tensors(space: Space, name: str, batch: object) -> Parts:
    """Return a batch of members of a space as tensors; see ``travels_as_tensors()``."""
    parts = Parts()
    _take_apart(space, name, batch, parts)
    return parts


@singledispatch
def _take_apart(space: Space, name: str, batch: object, parts: Parts) -> None:
    raise TypeError(f"no tensors for {type(space).__name__}")


for _kind in (Box, MultiBinary, MultiDiscrete):
    _take_apart.register(_kind, put_array)


@_take_apart.register
def _(space: Discrete, name: str, batch: object, parts: Parts) -> None:
    parts.tensors[name] = Tensor.of(np.asarray(batch, wide_dtype(space)))


@_take_apart.register
def _(space: Text, name: str, batch: tuple, parts: Parts) -> None:
    for sub_env, text in enumerate(batch):
        parts.texts[part_name(name, sub_env)] = encode(space, text)


@_take_apart.register
def _(space: Tuple, name: str, batch: tuple, parts: Parts) -> None:
    for index, (part, items) in enumerate(zip(space.spaces, batch, strict=True)):
        _take_apart(part, part_name(name, index), items, parts)


@_take_apart.register
def _(space: Dict, name: str, batch: dict, parts: Parts) -> None:
    for key, part in space.spaces.items():
        _take_apart(part, part_name(name, key), batch[key], parts)


def decode_sub_envs_tensors(
    space: Space, name: str, sent: Parts, num_envs: int, whose: str
) -> object:
    """Return the batch that tensors are, with the sub-environments along their first axes.

    Args:
        space: of one sub-environment.
        name: of the tensors.
        sent: the parts that were sent.
        num_envs: how many sub-environments there are.
        whose: as for ``decode_sub_envs()``.

    Raises:
        NotInSpace: as for ``decode_sub_envs()``, and for a part too few or too many, or of another
            dtype or shape.
    """
    left = Parts(dict(sent.tensors), dict(sent.texts))
    batch = _put_together(space, name, left, _SubEnvs(num_envs, whose))
    refuse_leftovers(space, name, left)
    return batch


class _SubEnvs(NamedTuple):
    """The sub-environments that a batch is for.

    Attributes:
        num_envs: how many there are.
        whose: names them; see ``decode_sub_envs()``.
        path: leads to the part of their members that is being decoded.
    """

    num_envs: int
    whose: str
    path: tuple[str | int, ...] = ()

    def inside(self, step: str | int) -> _SubEnvs:
        return self._replace(path=(*self.path, step))


@singledispatch
def _put_together(space: Space, name: str, parts: Parts, sub_envs: _SubEnvs) -> object:
    raise NotInSpace(space, name, "its members travel as JSON")


@_put_together.register
def _(space: Tuple, name: str, parts: Parts, sub_envs: _SubEnvs) -> object:
    return tuple(
        _put_together(part, part_name(name, index), parts, sub_envs.inside(index))
        for index, part in enumerate(space.spaces)
    )


@_put_together.register
def _(space: Dict, name: str, parts: Parts, sub_envs: _SubEnvs) -> object:
    return {
        key: _put_together(part, part_name(name, key), parts, sub_envs.inside(str(key)))
        for key, part in space.spaces.items()
    }


@_put_together.register
def _(space: Text, name: str, parts: Parts, sub_envs: _SubEnvs) -> object:
    try:
        return tuple(
            put_part_together(space, name, sub_env, parts, sub_env)
            for sub_env in range(sub_envs.num_envs)
        )
    except NotInSpace as refusal:
        refusal.path[1:1] = sub_envs.path
        raise


@_put_together.register(Box)
@_put_together.register(MultiBinary)
@_put_together.register(MultiDiscrete)
def _(space: ArraySpace, name: str, parts: Parts, sub_envs: _SubEnvs) -> object:
    return _take_sub_envs(space, name, space.dtype, parts, sub_envs)


@_put_together.register
def _(space: Discrete, name: str, parts: Parts, sub_envs: _SubEnvs) -> object:
    wide = wide_dtype(space)
    sent = parts.tensors.get(name)
    # R has only 32 bit integers.
    is_short = sent is not None and sent.dtype == "I32" and wide == np.int64
    array = _take_sub_envs(space, name, np.dtype(np.int32) if is_short else wide, parts, sub_envs)
    return array.astype(space.dtype, copy=False)


def _take_sub_envs(
    space: Any, name: str, dtype: np.dtype, parts: Parts, sub_envs: _SubEnvs
) -> np.ndarray:
    try:
        _check_number(space, parts.tensors.get(name), sub_envs)
        array = take_array(space, name, dtype, (sub_envs.num_envs, *(space.shape or ())), parts)
    except NotInSpace as refusal:
        refusal.path[:] = sub_envs.path
        raise
    try:
        check_bounds(space, bounds_of(space), array)
    except NotInSpace as refusal:
        # The first step of its path is the sub-environment.
        refusal.path[1:1] = sub_envs.path
        raise
    return array


def _check_number(space: Any, sent: Tensor | None, sub_envs: _SubEnvs) -> None:
    if not sent or not sent.shape or sent.shape[1:] != (space.shape or ()):
        return
    if sent.shape[0] != sub_envs.num_envs:
        raise NotInSpace(
            space,
            f"{sent.dtype} {list(sent.shape)}",
            f"one action for each of {sub_envs.whose} is needed, not {sent.shape[0]}",
        )
