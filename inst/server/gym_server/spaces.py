"""Spaces on the wire: describe them, encode their members, decode what a client sends.

Each of the three is a ``functools.singledispatch`` function; another kind of space is
supported by registering all three for its class.
"""

from __future__ import annotations

import math
from functools import singledispatch

import numpy as np
from gymnasium.spaces import Box, Discrete, Space

from gym_server.errors import GymServerError
from gym_server.plain import NONFINITE, brief

# Classic clients cannot read infinities; they know this number instead.
_BOUNDS = {math.inf: 1e100, -math.inf: -1e100}


class NotInSpace(Exception):  # noqa: N818 - it answers a question as often as it is an error
    """A value that is no member of a space."""

    def __init__(self, space: Space, value: object) -> None:
        super().__init__(f"{brief(value)} is not in {brief_space(space)}")


def brief_space(space: Space, width: int = 120) -> str:
    """Return a space as short text, for error messages."""
    text = repr(space)
    return text if len(text) <= width else text[: width - 3] + "..."


@singledispatch
def describe(space: Space) -> dict[str, object]:
    """Return a space's name, dtype and all that its constructor needs, as JSON values.

    Raises:
        GymServerError: ``unsupported_space`` for a kind of space without a description.
    """
    raise GymServerError(
        "unsupported_space",
        f"This server cannot speak of the space {brief_space(space)}: "
        f"spaces of kind {type(space).__name__} are not supported",
        "supported are " + " and ".join(sorted(_supported())),
    )


@singledispatch
def encode(space: Space, value: object) -> object:
    """Return a member of a space as JSON values (floats may still be non-finite)."""
    raise TypeError(f"no encoding for {type(space).__name__}")


@singledispatch
def decode(space: Space, value: object) -> object:
    """Return the member of a space that a JSON value stands for, in the space's dtype.

    Raises:
        NotInSpace: when the value stands for none.
    """
    raise TypeError(f"no decoding for {type(space).__name__}")


def contains(space: Space, space_info: dict, claim: dict) -> bool:
    """Answer "contains" as a client asks it.

    Args:
        space: the space.
        space_info: its description.
        claim: ``{"value": ...}`` asks whether a JSON value stands for a member; anything else is
            a classic client's description, such as ``{"name": "Box", "shape": [4]}``, and asks
            whether all of it is so.
    """
    if "value" not in claim:
        return all(
            name in space_info and _same(value, space_info[name]) for name, value in claim.items()
        )
    try:
        decode(space, claim["value"])
    except NotInSpace:
        return False
    return True


def _same(claimed: object, real: object) -> bool:
    if isinstance(real, list):
        # R's jsonlite writes a vector of length one as a bare value.
        claimed = claimed if isinstance(claimed, list) else [claimed]
        return len(claimed) == len(real) and all(map(_same, claimed, real))
    if _is_number(claimed) and isinstance(real, float):
        # It also writes 15 digits of a bound that has 17.
        return math.isclose(claimed, real, rel_tol=1e-12)  # type: ignore[arg-type]
    return type(claimed) is not bool and claimed == real


def _supported() -> list[str]:
    return [kind.__name__ for kind in describe.registry if kind is not object]


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


# Discrete ---------------------------------------------------------------------------------


@describe.register
def _(space: Discrete) -> dict[str, object]:
    return {
        "name": "Discrete",
        "n": int(space.n),
        "start": int(space.start),
        "dtype": space.dtype.name,
    }


@encode.register
def _(space: Discrete, value: object) -> object:
    return int(value)  # type: ignore[call-overload]


@decode.register
def _(space: Discrete, value: object) -> object:
    if not _is_number(value) or value % 1 != 0:  # type: ignore[operator]
        raise NotInSpace(space, value)
    number = int(value)  # type: ignore[call-overload]
    if not 0 <= number - int(space.start) < int(space.n):
        raise NotInSpace(space, value)
    return space.dtype.type(number)


# Box --------------------------------------------------------------------------------------


@describe.register
def _(space: Box) -> dict[str, object]:
    if space.dtype.kind == "f" and space.dtype.itemsize > 8:
        raise GymServerError(
            "unsupported_space",
            f"This server cannot speak of the space {brief_space(space)}: "
            f"its dtype {space.dtype.name} has more digits than the wire",
        )
    return {
        "name": "Box",
        "shape": list(space.shape),
        "dtype": space.dtype.name,
        "low": _bounds(space.low),
        "high": _bounds(space.high),
    }


def _bounds(bounds: np.ndarray) -> list:
    return [_BOUNDS.get(bound, bound) for bound in bounds.ravel().tolist()]


@encode.register
def _(space: Box, value: object) -> object:
    return np.asarray(value).tolist()


@decode.register
def _(space: Box, value: object) -> object:
    try:
        array = _array(space, value)
    except (ValueError, TypeError, OverflowError):
        raise NotInSpace(space, value) from None
    if not (np.all(array >= space.low) and np.all(array <= space.high)):
        raise NotInSpace(space, value)
    return array


def _array(space: Box, value: object) -> np.ndarray:
    if space.shape == (1,) and not isinstance(value, list):
        value = [value]
    element = _ELEMENT[space.dtype.kind]
    numbers = _each(element, value, max(len(space.shape), 1))
    if space.dtype.kind == "f":
        array = _float_array(numbers, space.dtype)
    else:
        array = _integer_array(numbers, space.dtype)
    if array.shape != space.shape and array.shape != (array.size,):
        raise ValueError("another shape")
    return array.reshape(space.shape)


def _each(element, value: object, depth: int) -> object:
    if isinstance(value, list):
        if depth == 0:
            raise ValueError("nested too deeply")
        return [_each(element, item, depth - 1) for item in value]
    return element(value)


def _float(value: object) -> float:
    if isinstance(value, str) and value in NONFINITE:
        return NONFINITE[value]
    if not _is_number(value):
        raise TypeError("not a number")
    return float(value)  # type: ignore[arg-type]


def _integer(value: object) -> int:
    if not _is_number(value) or value % 1 != 0:  # type: ignore[operator]
        raise TypeError("not an integer")
    return int(value)  # type: ignore[call-overload]


def _natural(value: object) -> int:
    number = _integer(value)
    if number < 0:
        raise OverflowError("negative")
    return number


def _boolean(value: object) -> bool:
    if value not in (0, 1):
        raise TypeError("not a boolean")
    return bool(value)


_ELEMENT = {"f": _float, "i": _integer, "u": _natural, "b": _boolean}


def _float_array(numbers: object, dtype: np.dtype) -> np.ndarray:
    doubles = np.array(numbers, dtype=np.float64)
    with np.errstate(over="ignore"):
        array = doubles.astype(dtype)
    # A number that the dtype cannot hold must not slip in as an infinity.
    if np.any(np.isinf(array) & np.isfinite(doubles)):
        raise OverflowError("out of the dtype's range")
    return array


def _integer_array(numbers: object, dtype: np.dtype) -> np.ndarray:
    # NumPy 1 wraps a number that a small dtype cannot hold, so the widest one comes first.
    wide = np.array(numbers, dtype=np.uint64 if dtype.kind == "u" else np.int64)
    array = wide.astype(dtype)
    if np.any(array != wide):
        raise OverflowError("out of the dtype's range")
    return array
