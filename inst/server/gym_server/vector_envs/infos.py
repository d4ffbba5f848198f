"""Combine the infos of sub-environments, in the format of Gymnasium's vector environments.

Each key has an array with an entry per sub-environment. A second array, under the key with a
leading ``_``, is a mask of the sub-environments that have the key. A dict is combined in the same
way. See https://gymnasium.farama.org/api/vector/.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, cast

import numpy as np

from gym_server.vector_envs.group import Infos

# The values of one key, by sub-environment.
Values = dict[int, object]


def gather(infos: Iterable[Infos | None], final: Mapping[int, object], num_envs: int) -> dict:
    """Combine the infos of sub-environments.

    Args:
        infos: one per sub-environment, or None for one without; empty if none are wanted.
        final: the last observations of episodes that ended, by sub-environment.
        num_envs: the number of sub-environments.
    """
    by_key: dict[str, Values] = {}
    for row, both in enumerate(infos):
        if both is not None:
            info, final_info = both
            if final_info is not None:
                by_key.setdefault("final_info", {})[row] = final_info
            for key, value in info.items():
                by_key.setdefault(key, {})[row] = value
    return {**_objects("final_obs", final, num_envs), **_arrays(by_key, num_envs)}


def _arrays(by_key: Mapping[str, Values], num_envs: int) -> dict:
    gathered: dict[str, Any] = {}
    for key, values in by_key.items():
        if all(isinstance(value, dict) for value in values.values()):
            members: dict[str, Values] = {}
            for row, value in values.items():
                for name, member in cast(dict, value).items():
                    members.setdefault(name, {})[row] = member
            gathered[key] = _arrays(members, num_envs)
            gathered[f"_{key}"] = _mask(values, num_envs)
        else:
            gathered.update(_numbers(key, values, num_envs) or _objects(key, values, num_envs))
    return gathered


def _numbers(key: str, values: Values, num_envs: int) -> dict | None:
    """Return the values as one array; None if no dtype fits all of them."""
    if not all(_is_number(value) or isinstance(value, np.ndarray) for value in values.values()):
        return None
    rows = {row: np.asarray(value) for row, value in values.items()}
    dtypes = {row.dtype for row in rows.values()}
    shapes = {row.shape for row in rows.values()}
    if len(shapes) > 1 or (len(dtypes) > 1 and any(dtype.kind not in "biufc" for dtype in dtypes)):
        return None
    array = np.zeros((num_envs, *shapes.pop()), dtype=np.result_type(*dtypes))
    for place, row in rows.items():
        array[place] = row
    return {key: array, f"_{key}": _mask(values, num_envs)}


def _is_number(value: object) -> bool:
    return type(value) in (int, float, bool) or isinstance(value, np.number)


def _objects(key: str, values: Mapping[int, object], num_envs: int) -> dict:
    if not values:
        return {}
    array = np.full(num_envs, None, dtype=object)
    for row, value in values.items():
        array[row] = value
    return {key: array, f"_{key}": _mask(values, num_envs)}


def _mask(values: Mapping[int, object], num_envs: int) -> np.ndarray:
    mask = np.zeros(num_envs, dtype=bool)
    mask[list(values)] = True
    return mask
