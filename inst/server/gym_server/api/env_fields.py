"""Fields that describe an environment, its sub-environments, or what to show of it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from gym_server.envs.config import Wrapper
from gym_server.protocol.fields import BOOLEAN, Field, Kind, boolean, integer, json_object, text

# Text that is visible on one line, and does not change the text direction of other lines.
_NAME = re.compile(
    "[^\\0-\\x1f\\x7f-\\x9f\\u200e\\u200f\\u2028-\\u202e\\u2066-\\u2069\\ufeff\\ud800-\\udfff]{,100}"
)


def _name(value: object) -> str:
    if _NAME.fullmatch(text(value)) is None:
        raise ValueError
    return text(value)


def _wrappers(value: object) -> tuple[Wrapper, ...]:
    if not isinstance(value, list):
        raise ValueError
    return tuple(map(_wrapper, map(json_object, value)))


def _wrapper(item: dict) -> Wrapper:
    name, kwargs = text(item.get("name")), item.get("kwargs")
    return Wrapper(name, {} if kwargs is None else json_object(kwargs))


def _video_callable(value: object) -> int:
    """Return 0 for no videos, or n for every n-th episode."""
    if isinstance(value, (bool, str)):
        return int(boolean(value))
    return integer(value)


def _positive(value: object) -> int:
    number = integer(value)
    if number < 1:
        raise ValueError
    return number


def _seed(value: object) -> object:
    return tuple(map(_own_seed, value)) if isinstance(value, list) else _one_seed(value)


def _reset_seed(value: object) -> object:
    if not isinstance(value, list):
        return _one_seed(value)
    return tuple(
        _later_seeds(item) if isinstance(item, list) else _own_seed(item) for item in value
    )


def _own_seed(value: object) -> int | None:
    return None if value is None else _one_seed(value)


def _later_seeds(values: list) -> tuple[int, ...]:
    if not values:
        raise ValueError
    return tuple(map(_one_seed, values))


def _one_seed(value: object) -> int:
    # A classic client may count with true and false.
    return int(value) if isinstance(value, bool) else integer(value)


def _mask(value: object) -> np.ndarray:
    mask = np.array(value) if isinstance(value, list) else None
    if mask is None or mask.dtype != np.bool_ or mask.ndim != 1:
        raise ValueError
    return mask


def _query_integer(value: object) -> int:
    """Read an integer from a query, where everything is text."""
    if not (isinstance(value, str) and value.isascii() and value.isdecimal()):
        raise ValueError
    return int(value)


def _letters(name: str) -> str:
    return name.lower().replace("_", "")


def named(names: Mapping[str, Any]) -> Kind:
    """Create a field that accepts some names, ignoring case and underscores."""
    by_letters = {_letters(name): meaning for name, meaning in names.items()}

    def parse(value: object) -> Any:
        if _letters(text(value)) not in by_letters:
            raise ValueError
        return by_letters[_letters(text(value))]

    return Kind(f"one of {', '.join(names)}", parse)


ANY_ID = Kind("a string", lambda value: value)
NAME = Kind("a text of 1 to 100 printable characters", _name)
WRAPPERS = Kind('a list of objects of a "name" and "kwargs"', _wrappers)
VIDEO_CALLABLE = Kind("true, false or an integer n for every n-th episode", _video_callable)
POSITIVE = Kind("an integer, 1 or greater", _positive)
SEED = Kind("an integer, 0 or greater, or a list of one, or null, for each sub-environment", _seed)
RESET_SEED = Kind(
    "an integer, 0 or greater, or a list of one, null, or a list of one or more, for each "
    "sub-environment",
    _reset_seed,
)
NUM_WORKERS = Kind("an integer, 0 or greater", integer)
MASK = Kind("a list of true or false for each sub-environment", _mask, empty_is_absent=False)
QUERY_INTEGER = Kind("an integer, 0 or greater", _query_integer)
VECTORIZATION_MODE = named({name: name for name in ("vector_entry_point", "sync", "async")})
AUTORESET_MODE = named({mode.value: mode for mode in AutoresetMode})
FINAL_OBS = Field("final_obs", BOOLEAN)
INFO = Field("info", BOOLEAN)
