"""Batches of members of a space, one for each sub-environment, as in Gymnasium's vector classes.

Arrays have the sub-environments along their first axis, Tuples and Dicts are batched part by part,
and Text, Sequence, Graph and OneOf have one entry for each sub-environment.  Nothing here loops
over the sub-environments of an array.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial, singledispatch
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
    TakeApart,
    array_putter,
    array_taker,
    dict_taker,
    part_name,
    refuse_leftovers,
    take_text,
    tuple_taker,
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


def batch_json_writer(space: Space) -> Callable[[Any], Any]:
    """Return ``encode_batch()`` for one space: its kind is not looked up for each batch."""
    return partial(encode_batch.dispatch(type(space)), space)


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


def batch_tensor_writer(space: Space, name: str) -> Callable[[Any, bool], Parts]:
    """Return what returns a batch of members as tensors of a name; see ``tensor_writer()``."""
    take_apart = _take_apart(space, name)

    def write(batch: Any, by_column: bool = False) -> Parts:
        parts = Parts({}, {}, by_column)
        take_apart(batch, parts)
        return parts

    return write


@singledispatch
def _take_apart(space: Space, name: str) -> TakeApart:
    raise TypeError(f"no tensors for {type(space).__name__}")


for _kind in (Box, MultiBinary, MultiDiscrete):
    _take_apart.register(_kind, array_putter)


@_take_apart.register
def _(space: Discrete, name: str) -> TakeApart:
    dtype = wide_dtype(space)

    def put(batch: Any, parts: Parts) -> None:
        parts.tensors[name] = Tensor.of(np.asarray(batch, dtype))

    return put


@_take_apart.register
def _(space: Text, name: str) -> TakeApart:
    def put(batch: Any, parts: Parts) -> None:
        for sub_env, text in enumerate(batch):
            parts.texts[part_name(name, sub_env)] = encode(space, text)

    return put


@_take_apart.register
def _(space: Tuple, name: str) -> TakeApart:
    return tuple_taker(
        [_take_apart(part, part_name(name, i)) for i, part in enumerate(space.spaces)]
    )


@_take_apart.register
def _(space: Dict, name: str) -> TakeApart:
    return dict_taker(
        {key: _take_apart(part, part_name(name, key)) for key, part in space.spaces.items()}
    )


def sub_envs_tensor_reader(space: Space, name: str) -> Callable[[Parts, int, str], object]:
    """Return what returns the batch that tensors are, with sub-environments along first axes.

    It is given the parts that were sent, how many sub-environments there are, and in words which
    these are, as ``decode_sub_envs()`` is.  It raises NotInSpace as that does, and for a part too
    few or too many, or of another dtype or shape.

    Args:
        space: of one sub-environment.
        name: of the tensors.
    """
    put_together = _put_together(space, name, ())

    def read(sent: Parts, num_envs: int, whose: str) -> object:
        left = Parts(dict(sent.tensors), dict(sent.texts))
        batch = put_together(left, num_envs, whose)
        refuse_leftovers(space, name, left)
        return batch

    return read


# Takes the parts of a batch out of others, and returns the batch of so many sub-environments.
_PutTogether = Callable[[Parts, int, str], object]


@singledispatch
def _put_together(space: Space, name: str, path: tuple[str | int, ...]) -> _PutTogether:
    """Return what puts a batch together, which a path leads to inside of the whole batch."""

    def refuse(parts: Parts, num_envs: int, whose: str) -> object:
        raise NotInSpace(space, name, "its members travel as JSON")

    return refuse


@_put_together.register
def _(space: Tuple, name: str, path: tuple[str | int, ...]) -> _PutTogether:
    parts_of = [
        _put_together(part, part_name(name, index), (*path, index))
        for index, part in enumerate(space.spaces)
    ]
    return lambda *how: tuple([put_together(*how) for put_together in parts_of])


@_put_together.register
def _(space: Dict, name: str, path: tuple[str | int, ...]) -> _PutTogether:
    parts_of = {
        key: _put_together(part, part_name(name, key), (*path, str(key)))
        for key, part in space.spaces.items()
    }
    return lambda *how: {key: put_together(*how) for key, put_together in parts_of.items()}


@_put_together.register
def _(space: Text, name: str, path: tuple[str | int, ...]) -> _PutTogether:
    def put_together(parts: Parts, num_envs: int, whose: str) -> object:
        texts = []
        for sub_env in range(num_envs):
            try:
                texts.append(take_text(space, part_name(name, sub_env), parts))
            except NotInSpace as refusal:
                refusal.path[:0] = (sub_env, *path)
                raise
        return tuple(texts)

    return put_together


@_put_together.register(Box)
@_put_together.register(MultiBinary)
@_put_together.register(MultiDiscrete)
def _(space: ArraySpace, name: str, path: tuple[str | int, ...]) -> _PutTogether:
    return _array_together(space, name, space.dtype, path)


@_put_together.register
def _(space: Discrete, name: str, path: tuple[str | int, ...]) -> _PutTogether:
    wide, dtype = wide_dtype(space), space.dtype
    of_wide = _array_together(space, name, wide, path)
    if wide != np.int64:
        return of_wide
    of_short = _array_together(space, name, np.dtype(np.int32), path)

    def put_together(parts: Parts, num_envs: int, whose: str) -> object:
        sent = parts.tensors.get(name)
        # R has only 32 bit integers.
        is_short = sent is not None and sent.dtype == "I32"
        array = (of_short if is_short else of_wide)(parts, num_envs, whose)
        return array.astype(dtype, copy=False)

    return put_together


def _array_together(
    space: Any, name: str, dtype: np.dtype, path: tuple[str | int, ...]
) -> Callable[[Parts, int, str], np.ndarray]:
    take, bounds, shape = array_taker(space, name, dtype), bounds_of(space), space.shape or ()

    def put_together(parts: Parts, num_envs: int, whose: str) -> np.ndarray:
        try:
            _check_number(space, shape, parts.tensors.get(name), num_envs, whose)
            array = take(parts, (num_envs, *shape))
        except NotInSpace as refusal:
            refusal.path[:] = path
            raise
        try:
            check_bounds(space, bounds, array)
        except NotInSpace as refusal:
            # The first step of its path is the sub-environment.
            refusal.path[1:1] = path
            raise
        return array

    return put_together


def _check_number(
    space: Space, shape: tuple[int, ...], sent: Tensor | None, num_envs: int, whose: str
) -> None:
    if not sent or not sent.shape or sent.shape[1:] != shape:
        return
    if sent.shape[0] != num_envs:
        raise NotInSpace(
            space,
            f"{sent.dtype} {list(sent.shape)}",
            f"one action for each of {whose} is needed, not {sent.shape[0]}",
        )
