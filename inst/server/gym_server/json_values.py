"""Convert the values that an environment returns to plain JSON values."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

NONFINITE = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}

# The maximum length of an error message, in characters.
LONGEST_MESSAGE = 2000

# Deeper than any reasonable info, and shallow enough for the recursion of the JSON encoder.
# Structures that contain themselves are cut off here.
_DEEPEST = 128


def plain(value: object, depth: int = 0) -> object:
    """Convert any value to None, booleans, integers, finite floats, strings, lists and dicts.

    NumPy scalars and arrays become Python's. Mappings get string keys. Non-finite numbers become
    "NaN", "Infinity" or "-Infinity". Anything that JSON cannot express becomes its ``repr()``.

    Args:
        value: anything.
        depth: the number of containers around the value.
    """
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, (float, np.floating)):
        return _number(float(value))
    if depth > _DEEPEST:
        return _repr(value)
    if isinstance(value, np.ndarray):
        return plain(value.tolist(), depth) if value.dtype != object else _array(value, depth)
    if isinstance(value, (np.bool_, np.integer)):
        return value.item()
    if isinstance(value, (dict, Mapping)):
        return {_key(key): plain(item, depth + 1) for key, item in value.items()}
    if isinstance(value, Iterable) and not isinstance(value, (bytes, bytearray, memoryview)):
        return _items(value, depth)
    return _repr(value)


def brief(value: object, width: int = 80) -> str:
    """Return a value as JSON text of at most ``width`` characters, for error messages."""
    try:
        return shortened(json.dumps(plain(value)), width)
    except ValueError:
        # Such as an integer of more digits than Python writes.
        return shortened(_repr(type(value)), width)


def shortened(text: str, width: int) -> str:
    """Cut a text to at most ``width`` characters."""
    return text if len(text) <= width else text[: width - 3] + "..."


def _number(value: float) -> float | str:
    if math.isfinite(value):
        return value
    return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"


def _array(value: np.ndarray, depth: int) -> object:
    return _items(value, depth) if value.ndim else plain(value.item(), depth + 1)


def _items(value: Iterable, depth: int) -> object:
    # Only types that are always finite: an iterator in an info may be endless.
    if isinstance(value, (list, tuple, set, frozenset, np.ndarray, range)):
        return [plain(item, depth + 1) for item in value]
    return _repr(value)


def _key(key: object) -> str:
    return key if isinstance(key, str) else str(plain(key))


def _repr(value: object) -> str:
    try:
        return repr(value)
    except Exception:
        return f"<{type(value).__name__}>"


def parse_nonfinite(value: object) -> Any:
    """Replace "NaN", "Infinity" and "-Infinity" in JSON values by the numbers they name."""
    if isinstance(value, str):
        return NONFINITE.get(value, value)
    if isinstance(value, list):
        return [parse_nonfinite(item) for item in value]
    if isinstance(value, dict):
        return {key: parse_nonfinite(item) for key, item in value.items()}
    return value
