"""What the fields of requests may hold that are about sub-environments."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from gym_server.errors import invalid_parameter
from gym_server.protocol import wire
from gym_server.protocol.wire import Kind


def _num_envs(value: object) -> int:
    number = wire.integer(value)
    if number < 1:
        raise ValueError
    return number


def _seed(value: object) -> int | tuple[int | None, ...]:
    if not isinstance(value, list):
        return _one_seed(value)
    try:
        return tuple(None if seed is None else _one_seed(seed) for seed in value)
    except ValueError:
        wanted = "an integer, 0 or greater, or a list of one, or null, for each sub-environment"
        raise invalid_parameter("seed", value, wanted) from None


def _one_seed(value: object) -> int:
    # A classic client may count with what it calls true and false.
    return int(value) if isinstance(value, bool) else wire.integer(value)


def _mask(value: object) -> np.ndarray:
    mask = np.array(value) if isinstance(value, list) else None
    if mask is None or mask.dtype != np.bool_ or mask.ndim != 1:
        raise ValueError
    return mask


def _sub_env(value: object) -> int:
    """Return a number out of a query, where everything is text."""
    if not (isinstance(value, str) and value.isascii() and value.isdecimal()):
        raise ValueError
    return int(value)


def _one_of(names: Mapping[str, Any]) -> Callable[[object], Any]:
    by_letters = {_letters(name): meaning for name, meaning in names.items()}

    def parse(value: object) -> Any:
        meaning = by_letters.get(_letters(wire.text(value)))
        if meaning is None:
            raise ValueError
        return meaning

    return parse


def _letters(name: str) -> str:
    return name.lower().replace("_", "")


def _named(names: Mapping[str, Any]) -> Kind:
    """Declare a field that holds one of some names, whatever their case and underscores."""
    written = [f'"{name}"' for name in names]
    wanted = f"{', '.join(written[:-1])} or {written[-1]}"
    return Kind({"type": "string", "enum": list(names)}, wanted, _one_of(names))


NUM_ENVS = Kind({"type": "integer", "minimum": 1}, "an integer, 1 or greater", _num_envs)
SEED = Kind(
    {
        "oneOf": [
            {"type": ["integer", "boolean"], "minimum": 0},
            {
                "type": "array",
                "items": {"type": ["integer", "boolean", "null"], "minimum": 0},
                "minItems": 1,
            },
        ]
    },
    "an integer, 0 or greater",
    _seed,
)
MASK = Kind(
    {"type": "array", "items": {"type": "boolean"}, "minItems": 1},
    "a list of true or false for each sub-environment",
    _mask,
    empty_is_absent=False,
)
SUB_ENV = Kind({"type": "integer", "minimum": 0}, "an integer, 0 or greater", _sub_env)
VECTORIZATION_MODE = _named({name: name for name in ("vector_entry_point", "sync", "async")})
AUTORESET_MODE = _named({mode.value: mode for mode in AutoresetMode})
