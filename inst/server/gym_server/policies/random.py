"""Act at random, with the same draws as Gymnasium's ``sample()``."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete, Space
from gymnasium.vector.utils import batch_space
from numpy.random import Generator

from gym_server.errors import invalid_policy
from gym_server.json_values import brief
from gym_server.policies.acting import Actor, Policy
from gym_server.policies.draws import Draws
from gym_server.policies.reading import check_fields
from gym_server.spaces import brief_space, parts_of


@dataclass(frozen=True)
class RandomPolicy(Policy):
    """Draws each action from a space."""

    space: Space

    @property
    def candidates(self) -> None:
        """None, because all candidates act alike."""

    def actor(self, candidate: int | np.ndarray) -> Actor:
        """Return an actor with its own draws; for a group it draws all rows at once."""
        space = copy.deepcopy(self.space)
        if isinstance(candidate, int):
            draws = _draws(space)
        else:
            draws = _one_by_one(batch_space(space, len(candidate)))
        return Actor(draws.take, draws)


def read_random(
    document: Mapping,
    tensors: Mapping[str, np.ndarray],
    observation_space: Space,
    action_space: Space,
) -> RandomPolicy:
    """Read a random policy, which may have its own action space."""
    check_fields(document, tensors, "action_space")
    own = document.get("action_space")
    return RandomPolicy(action_space if own is None else _narrower(own, action_space))


def _narrower(own: object, action_space: Space) -> Discrete:
    if not isinstance(action_space, Discrete):
        raise invalid_policy(
            f"A random policy can have its own action space only if the environment's is Discrete, "
            f"not {brief_space(action_space)}",
            "omit its action_space",
        )
    parts = own if isinstance(own, Mapping) and own.keys() <= {"n", "start"} else {}
    n, start, first = parts.get("n"), parts.get("start", 0), int(action_space.start)
    if (
        type(n) is not int
        or type(start) is not int
        or not (first <= start < start + n <= first + int(action_space.n))
    ):
        raise invalid_policy(
            f'The policy\'s action_space must be {{"n", "start"}}, within the environment\'s '
            f"{brief_space(action_space)}, not {brief(own)}"
        )
    # Copy it, because only newer versions of Gymnasium have a dtype argument.
    narrower = copy.deepcopy(action_space)
    narrower.n = action_space.dtype.type(n)
    narrower.start = action_space.dtype.type(start)
    return narrower


def _draws(space: Space) -> Draws:
    # Only these kinds: below 32 bits, Gymnasium draws several numbers at once from 32 bits.
    if type(space) is Discrete and space.dtype.itemsize >= 4:
        n, start, kind = space.n, space.start, space.dtype.type
        return Draws(lambda rng, size: list(start + rng.integers(n, size=size, dtype=kind)))
    # A block of single numbers would become scalars, instead of arrays without axes.
    if type(space) is Box and space.shape and space.dtype.kind == "f" and _has_finite_range(space):
        low, high, shape, dtype = space.low, space.high, space.shape, space.dtype
        return Draws(
            lambda rng, size: list(rng.uniform(low, high, (size, *shape)).astype(dtype)),
            most=max(1, min(256, 4096 // max(1, low.size))),
        )
    return _one_by_one(space)


def _has_finite_range(space: Box) -> bool:
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(space.high - space.low).all())


def _one_by_one(space: Space) -> Draws:
    nodes = _with_parts(space)

    def sample(generator: Generator, size: int) -> list[Any]:
        for node in nodes:
            node._np_random = generator
        return [space.sample()]

    return Draws(sample, most=1)


def _with_parts(space: Space) -> list[Space]:
    """Return a space and all spaces in it, which share one generator."""
    return [space, *(inner for part in parts_of(space) for inner in _with_parts(part))]
