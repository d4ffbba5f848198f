"""Stack members of a space to a batch, as Gymnasium does, and take batches apart."""

from __future__ import annotations

from functools import singledispatch
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, MultiDiscrete, Space, Tuple

# The spaces whose batches are one array.
ARRAYS = (Box, Discrete, MultiBinary, MultiDiscrete)


@singledispatch
def stack(space: Space, members: list) -> Any:
    """Stack members of a space to a batch: arrays with the members along the first axis.

    Tuples and Dicts are stacked part by part. Text, Sequence, Graph and OneOf become a tuple of the
    members.
    """
    return tuple(members)


@stack.register(Box)
@stack.register(Discrete)
@stack.register(MultiBinary)
@stack.register(MultiDiscrete)
def _(space: Space, members: list) -> object:
    return np.array(members, dtype=space.dtype).reshape(len(members), *(space.shape or ()))


@stack.register
def _(space: Tuple, members: list) -> object:
    return tuple(
        stack(part, [member[index] for member in members])
        for index, part in enumerate(space.spaces)
    )


@stack.register
def _(space: Dict, members: list) -> object:
    return {
        key: stack(part, [member[key] for member in members]) for key, part in space.spaces.items()
    }


@singledispatch
def unstack(space: Space, batch: Any) -> list:
    """Return the members of a batch."""
    return list(batch)


@unstack.register
def _(space: Tuple, batch: tuple) -> list:
    parts = [unstack(part, items) for part, items in zip(space.spaces, batch, strict=True)]
    return list(zip(*parts, strict=True))


@unstack.register
def _(space: Dict, batch: dict) -> list:
    parts = [unstack(part, batch[key]) for key, part in space.spaces.items()]
    return [dict(zip(space.spaces, member, strict=True)) for member in zip(*parts, strict=True)]


def member_of(space: Space, batch: Any, row: int) -> object:
    """Return one member of a batch, in the format of Gymnasium's vector environments."""
    match space:
        case Dict():
            return {key: member_of(part, batch[key], row) for key, part in space.spaces.items()}
        case Tuple():
            parts = zip(space.spaces, batch, strict=True)
            return tuple(member_of(part, items, row) for part, items in parts)
        case _:
            return batch[row]


def join(space: Space, batches: list) -> Any:
    """Concatenate batches in the format of Gymnasium's vector environments."""
    if len(batches) == 1:
        return batches[0]
    match space:
        case Tuple():
            return tuple(
                join(part, [batch[index] for batch in batches])
                for index, part in enumerate(space.spaces)
            )
        case Dict():
            return {
                key: join(part, [batch[key] for batch in batches])
                for key, part in space.spaces.items()
            }
        case _ if isinstance(space, ARRAYS):
            return np.concatenate(batches)
        case _:
            return tuple(member for batch in batches for member in batch)
