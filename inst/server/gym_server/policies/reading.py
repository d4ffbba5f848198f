"""Read the fields and tensors of a policy; unknown ones are errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from gym_server.errors import invalid_policy
from gym_server.json_values import brief


def check_fields(document: Mapping, tensors: Mapping[str, np.ndarray], *known: str) -> None:
    """Refuse fields and tensors that a policy of this kind does not have."""
    for what, given in (("field", document), ("tensor", tensors)):
        for name in given:
            if name not in known and name != "kind":
                raise invalid_policy(
                    f"A {document['kind']} policy has no {what} {brief(name)}",
                    f"it may have {', '.join(known) or 'none'}",
                )


def field(document: Mapping, name: str, fits: Callable[[Any], bool], wanted: str) -> Any:
    """Return a field; None if it is missing and may be."""
    value = document.get(name)
    if not fits(value):
        raise invalid_policy(f"The policy's {name} must be {wanted}, not {brief(value)}")
    return value


def number(document: Mapping, name: str, low: float, high: float, wanted: str) -> float | None:
    """Return a field that is a number from ``low`` to ``high``; None if it is missing."""

    def fits(value: object) -> bool:
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        return value is None or (is_number and low <= value <= high)  # type: ignore[operator]

    value = field(document, name, fits, wanted)
    return None if value is None else float(value)


def epsilon_of(document: Mapping) -> float | None:
    """Return how often a policy explores."""
    return number(document, "epsilon", 0, 1, "a number from 0 to 1")


def above_zero(document: Mapping, name: str) -> float | None:
    """Return a field that is a finite number above 0; None if it is missing."""
    smallest, largest = math.nextafter(0, 1), math.nextafter(math.inf, 0)
    return number(document, name, smallest, largest, "a number above 0")


def numbers(tensors: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    """Return a required tensor as float64."""
    if name not in tensors:
        raise invalid_policy(f"The policy has no tensor {name}", f"send policy/{name}")
    tensor = np.asarray(tensors[name])
    if tensor.dtype.kind not in "fiu":
        raise invalid_policy(f"The policy's {name} must be numbers, not {tensor.dtype.name}")
    return tensor.astype(np.float64)


def finite_numbers(
    tensors: Mapping[str, np.ndarray], name: str, shapes: list[tuple[int | None, ...]], wanted: str
) -> np.ndarray:
    """Return a required tensor with one of some shapes, without Inf and NaN.

    Args:
        tensors: all tensors.
        name: its name.
        shapes: the allowed shapes; a length of None means any from 1.
        wanted: the shapes in words.
    """
    tensor = numbers(tensors, name)
    if not any(_matches(tensor.shape, shape) for shape in shapes):
        raise invalid_policy(
            f"The policy's {name} must be {wanted}, not {shape_text(tensor.shape)}"
        )
    if not np.isfinite(tensor).all():
        wrong = float(tensor[~np.isfinite(tensor)][0])
        raise invalid_policy(f"The policy's {name} must be finite numbers, not {brief(wrong)}")
    return tensor


def _matches(shape: tuple[int, ...], wanted: tuple[int | None, ...]) -> bool:
    return len(shape) == len(wanted) and all(
        found > 0 if length is None else found == length
        for found, length in zip(shape, wanted, strict=True)
    )


def shape_text(shape: tuple[int, ...]) -> str:
    """Return a shape as text: 2 x 3."""
    return " x ".join(map(str, shape)) or "a single number"


def count_of(n: int, noun: str) -> str:
    """Return a number with its noun: 1 input, 2 inputs."""
    return f"{n:,} {noun}" + ("" if n == 1 else "s")
