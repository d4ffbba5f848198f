"""What a worker process does for a group of sub-environments, one group at a time."""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from typing import Any

from gymnasium.vector import AutoresetMode

from gym_server.processes import start
from gym_server.vector_envs.group import Group
from gym_server.vector_envs.sub_env import SubEnv

# Importing it takes longer than starting a process.
start.preload(__name__)

_group: Group


def make(pickled: bytes, numbers: Sequence[int], mode: AutoresetMode) -> None:
    """Make the group; the arguments are those of ``Group``.

    The first argument is pickled separately: if it cannot be unpickled here, that is an error. A
    call that cannot be unpickled would end the process.
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
    """Close and forget the group."""
    global _group
    group = _group
    del _group
    group.close()
