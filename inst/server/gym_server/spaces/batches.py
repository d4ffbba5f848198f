"""Batches of members, one per sub-environment, as in Gymnasium's vector environments.

Arrays have the sub-environments along their first axis. Tuples and Dicts are batched part by part.
Text, Sequence, Graph and OneOf have a tuple with one entry per sub-environment. Arrays are handled
without a loop over the sub-environments.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, MultiDiscrete, Space, Tuple

from gym_server.spaces.arrays import (
    bounds_of,
    choice_reader_of,
    read_array,
    read_bit,
    reader_of,
)
from gym_server.spaces.discrete import wide_dtype
from gym_server.spaces.kinds import NotInSpace, decode_part, encode
from gym_server.spaces.stacking import ARRAYS, stack
from gym_server.spaces.tensor_parts import Rows


@singledispatch
def encode_batch(space: Space, batch: Any) -> Any:
    """Encode a batch of members as JSON values (floats may still be non-finite)."""
    return [encode(space, member) for member in batch]


# A batch of arrays is an array.
for _kind in (Box, MultiBinary, MultiDiscrete):
    encode_batch.register(_kind, encode.dispatch(_kind))


@encode_batch.register
def _(space: Discrete, batch: object) -> object:
    return np.asarray(batch).tolist()


@encode_batch.register
def _(space: Tuple, batch: tuple) -> object:
    return [encode_batch(part, items) for part, items in zip(space.spaces, batch, strict=True)]


@encode_batch.register
def _(space: Dict, batch: dict) -> object:
    return {str(key): encode_batch(part, batch[key]) for key, part in space.spaces.items()}


def decode_sub_envs(space: Space, value: object, rows: Rows) -> object:
    """Decode a list of JSON values, one per sub-environment, to a batch.

    Args:
        space: the space of one sub-environment.
        value: the list.
        rows: the sub-environments.

    Raises:
        NotInSpace: the list has the wrong length, or a value is not a member. The path then starts
            with the sub-environment's index, from 0.
    """
    if not isinstance(value, list) or len(value) != rows.number:
        found = f", not {len(value)}" if isinstance(value, list) else ", as a list"
        raise NotInSpace(space, value, f"one action for each of {rows.whose} is needed{found}")
    if isinstance(space, ARRAYS):
        try:
            return _all_at_once(space, value)
        except (TypeError, ValueError, OverflowError, NotInSpace):
            # Decode one by one: some values may be written in another allowed way. If not, the
            # error names the sub-environment.
            pass
    return stack(space, [decode_part(space, item, sub_env) for sub_env, item in enumerate(value)])


class _Batched(NamedTuple):
    """The part of a batched space that ``read_array()`` needs."""

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
    if not bounds_of(space).hold(array):
        raise ValueError("out of bounds")
    return array.astype(space.dtype)


def _reader_of(space: Any) -> Callable[[object], object]:
    match space:
        case MultiBinary():
            return read_bit
        case MultiDiscrete():
            return choice_reader_of(space.dtype)
        case _:
            return reader_of(space.dtype)
