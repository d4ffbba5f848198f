"""List the numbers and texts in an observation, with names, for watchers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

# At most this many are shown.
_MOST = 64
_LONGEST_TEXT = 200


def entries(observation: object) -> dict:
    """Return the numbers and texts in an observation of any structure.

    Returns:
        ``{"names", "values", "size"}``: at most 64 names and values, and how many there are. A
        name is a path, such as ``camera[0]``, or "" if the observation is a single value.
    """
    names: list[str] = []
    values: list[float | int | str] = []
    size = 0
    for name, leaf in _leaves("", observation):
        array = np.asarray(leaf)
        size += array.size
        room = _MOST - len(values)
        if room > 0:
            shown = array.reshape(-1)[:room]
            names += [name] if array.ndim == 0 else [f"{name}[{i}]" for i in range(len(shown))]
            values += [_value(item) for item in shown.tolist()]
    return {"names": names, "values": values, "size": size}


def _leaves(name: str, value: object) -> Iterator[tuple[str, object]]:
    if isinstance(value, Mapping):
        for key, part in value.items():
            yield from _leaves(f"{name}.{key}" if name else str(key), part)
    elif isinstance(value, tuple) and hasattr(value, "_asdict"):
        # A GraphInstance.
        yield from _leaves(name, value._asdict())
    elif isinstance(value, (tuple, list)):
        for index, part in enumerate(value):
            yield from _leaves(f"{name}[{index}]", part)
    elif value is not None:
        yield name, value


def _value(item: object) -> float | int | str:
    if isinstance(item, (bool, int, float)):
        return item
    text = str(item)
    return text if len(text) <= _LONGEST_TEXT else text[: _LONGEST_TEXT - 1] + "…"
