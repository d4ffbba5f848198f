"""The infos of sub-environments as one, in the form of Gymnasium's vector environments.

Each key has an array with an entry for each sub-environment, and beside it, under the key with
``_`` before it, a mask of those that have the key. A dict becomes such a dict again.
https://gymnasium.farama.org/api/vector/ describes it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from gym_server.vector_envs.group import Info


def gather(infos: Iterable[Info | None], final: Mapping[int, object], num_envs: int) -> dict:
    """Return the infos of sub-environments as one.

    Args:
        infos: of each sub-environment; None for one that has none.
        final: the last observations of episodes that ended, by sub-environment.
        num_envs: how many sub-environments there are.
    """
    gathered: dict[str, Any] = {}
    for row, info in enumerate(infos):
        if row in final:
            _enter_object(gathered, "final_obs", final[row], row, num_envs)
        if info is not None:
            if info.final is not None:
                _enter(gathered, {"final_info": info.final}, row, num_envs)
            _enter(gathered, info.info, row, num_envs)
    return gathered


def final_only(final: Mapping[int, object], num_envs: int) -> dict:
    """Return an info that holds the last observations and nothing else."""
    return gather([None] * num_envs, final, num_envs) if final else {}


def _enter(gathered: dict[str, Any], info: dict, row: int, num_envs: int) -> None:
    for key, value in info.items():
        if isinstance(value, dict):
            _enter(gathered.setdefault(key, {}), value, row, num_envs)
            _mark(gathered, key, row, num_envs)
        elif key in gathered:
            gathered[key][row] = value
            _mark(gathered, key, row, num_envs)
        elif type(value) in (int, float, bool) or isinstance(value, np.number):
            gathered[key] = np.zeros(num_envs, dtype=type(value))
            gathered[key][row] = value
            _mark(gathered, key, row, num_envs)
        elif isinstance(value, np.ndarray):
            gathered[key] = np.zeros((num_envs, *value.shape), dtype=value.dtype)
            gathered[key][row] = value
            _mark(gathered, key, row, num_envs)
        else:
            _enter_object(gathered, key, value, row, num_envs)


def _enter_object(gathered: dict, key: str, value: object, row: int, num_envs: int) -> None:
    if key not in gathered:
        gathered[key] = np.full(num_envs, None, dtype=object)
    gathered[key][row] = value
    _mark(gathered, key, row, num_envs)


def _mark(gathered: dict, key: str, row: int, num_envs: int) -> None:
    mask = f"_{key}"
    if mask not in gathered:
        gathered[mask] = np.zeros(num_envs, dtype=bool)
    gathered[mask][row] = True
