"""Act at random, with the draws of Gymnasium's ``sample()``."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict, Discrete, Graph, OneOf, Sequence, Space, Tuple
from gymnasium.vector.utils import batch_space
from numpy.random import Generator

from gym_server.errors import invalid_policy
from gym_server.json_values import brief
from gym_server.policies.acting import Actor, GroupActor, Policy
from gym_server.policies.draws import Draws
from gym_server.policies.fields import check_fields
from gym_server.spaces import brief_space


class RandomPolicy(Policy):
    """Draws each action from a space."""

    candidates = None

    def __init__(self, action_space: Space) -> None:
        self._space = action_space

    def actor(self, candidate: int) -> Actor:
        """Return an actor that draws from a generator of its own."""
        draws = _draws(copy.deepcopy(self._space))
        return Actor(draws.take, draws)

    def group_actor(self, candidates: np.ndarray, num_envs: int) -> GroupActor:
        """Return an actor that draws the actions of all rows at once, whoever plays them."""
        draws = _one_by_one(copy.deepcopy(batch_space(self._space, num_envs)))
        return GroupActor(draws.take, draws)


def read_random(
    document: Mapping,
    tensors: Mapping[str, np.ndarray],
    observation_space: Space,
    action_space: Space,
) -> RandomPolicy:
    """Read a random policy, which may have an action space of its own."""
    check_fields(document, tensors, "action_space")
    own = document.get("action_space")
    return RandomPolicy(action_space if own is None else _narrower(own, action_space))


def _narrower(own: object, action_space: Space) -> Discrete:
    if not isinstance(action_space, Discrete):
        raise invalid_policy(
            f"A random policy can have fewer actions where they are Discrete, and here they are "
            f"{brief_space(action_space)}",
            "leave its action_space out",
        )
    if not isinstance(own, Mapping) or not own.keys() <= {"n", "start"}:
        raise invalid_policy(
            f'The policy\'s action_space must be {{"n", "start"}}, not {brief(own)}'
        )
    n, start = own.get("n"), own.get("start", 0)
    if type(n) is not int or type(start) is not int or n < 1 or not _within(n, start, action_space):
        raise invalid_policy(
            f"The policy's actions are {brief(own)}, but the environment takes "
            f"{brief_space(action_space)}"
        )
    # A copy and not a new one: only newer versions of Gymnasium have a dtype.
    narrower = copy.deepcopy(action_space)
    narrower.n = action_space.dtype.type(n)
    narrower.start = action_space.dtype.type(start)
    return narrower


def _within(n: int, start: int, outer: Discrete) -> bool:
    first = int(outer.start)
    return start >= first and start + n <= first + int(outer.n)


def _draws(space: Space) -> Draws:
    # Only these kinds: of numbers below 32 bits Gymnasium draws several at once from one of 32.
    if type(space) is Discrete and space.dtype.itemsize >= 4:
        return Draws(_discrete_block(space))
    # A block of single numbers falls apart into scalars, and not into arrays without axes.
    if type(space) is Box and space.shape and space.dtype.kind == "f" and _has_finite_range(space):
        return Draws(_box_block(space), most=max(1, min(256, 4096 // max(1, space.low.size))))
    return _one_by_one(space)


def _discrete_block(space: Discrete) -> Callable[[Generator, int], list[Any]]:
    n, start, dtype = space.n, space.start, space.dtype.type
    return lambda generator, size: list(start + generator.integers(n, size=size, dtype=dtype))


def _has_finite_range(space: Box) -> bool:
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(space.high - space.low).all())


def _box_block(space: Box) -> Callable[[Generator, int], list[Any]]:
    low, high, dtype = space.low, space.high, space.dtype
    return lambda generator, size: list(
        generator.uniform(low, high, (size, *space.shape)).astype(dtype)
    )


def _one_by_one(space: Space) -> Draws:
    nodes = _with_parts(space)

    def sample(generator: Generator, size: int) -> list[Any]:
        for node in nodes:
            node._np_random = generator
        return [space.sample()]

    return Draws(sample, most=1)


def _with_parts(space: Space) -> list[Space]:
    """Return a space and all spaces in it: they share one generator."""
    match space:
        case Dict():
            parts = list(space.spaces.values())
        case Tuple() | OneOf():
            parts = list(space.spaces)
        case Sequence():
            parts = [space.feature_space]
        case Graph():
            parts = [part for part in (space.node_space, space.edge_space) if part is not None]
        case _:
            parts = []
    return [space, *(inner for part in parts for inner in _with_parts(part))]
