"""What a process of the pool does for a group of sub-environments, one group at a time."""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from typing import Any

from gymnasium.vector import AutoresetMode

from gym_server.processes import start
from gym_server.vector_envs.group import Group
from gym_server.vector_envs.sub_env import SubEnv

# Its imports take longer than the start of a process.
start.preload(__name__)

_group: Group


def make(pickled: bytes, numbers: Sequence[int], mode: AutoresetMode) -> None:
    """Make the group; its arguments are those of ``Group``.

    The first one is pickled by itself: a call that cannot be read ends the process, and this is an
    error.
    """
    global _group
    sub_env: SubEnv = pickle.loads(pickled)
    sub_env.prepare()
    _group = Group(sub_env, numbers, mode)


def reset(*args: Any) -> object:
    """See ``Group.reset()``."""
    return _group.reset(*args)


def step(*args: Any) -> object:
    """See ``Group.step()``."""
    return _group.step(*args)


def render(index: int) -> object:
    """See ``Group.render()``."""
    return _group.render(index)


def observed(index: int) -> object:
    """See ``Group.observed()``."""
    return _group.observed(index)


def close() -> None:
    """Close the group, and forget it."""
    global _group
    group = _group
    del _group
    group.close()
