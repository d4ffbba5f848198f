"""Stack members of a space to a batch, as Gymnasium does, and take batches apart."""

from __future__ import annotations

from collections.abc import Iterable
from functools import singledispatch
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, MultiDiscrete, Space, Tuple

# The spaces whose batches are one array.
ARRAYS = (Box, Discrete, MultiBinary, MultiDiscrete)


def keyed(space: Tuple | Dict) -> Iterable[tuple[Any, Space]]:
    """Return the parts of a space, each with the key of that part in a member."""
    return space.spaces.items() if isinstance(space, Dict) else enumerate(space.spaces)


def from_parts(space: Tuple | Dict, values: Iterable) -> Any:
    """Return a member, or a batch, made of its parts."""
    return (
        dict(zip(space.spaces, values, strict=True)) if isinstance(space, Dict) else tuple(values)
    )


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


@stack.register(Tuple)
@stack.register(Dict)
def _(space: Any, members: list) -> object:
    return from_parts(
        space, [stack(part, [member[key] for member in members]) for key, part in keyed(space)]
    )


@singledispatch
def unstack(space: Space, batch: Any) -> list:
    """Return the members of a batch."""
    return list(batch)


@unstack.register(Tuple)
@unstack.register(Dict)
def _(space: Any, batch: Any) -> list:
    parts = [unstack(part, batch[key]) for key, part in keyed(space)]
    return [from_parts(space, member) for member in zip(*parts, strict=True)]


def join(space: Space, batches: list) -> Any:
    """Concatenate batches in the format of Gymnasium's vector environments."""
    if len(batches) == 1:
        return batches[0]
    if isinstance(space, (Tuple, Dict)):
        return from_parts(
            space, [join(part, [batch[key] for batch in batches]) for key, part in keyed(space)]
        )
    if isinstance(space, ARRAYS):
        return np.concatenate(batches)
    return tuple(member for batch in batches for member in batch)
