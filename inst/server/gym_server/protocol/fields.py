"""The fields of a request: what each may contain, and how to read it."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

from gym_server.errors import invalid_parameter, missing_parameter


@dataclass(frozen=True)
class Kind:
    """The values that a field may have.

    Attributes:
        wanted: a description that completes "must be ...".
        parse: converts the JSON value; raises ValueError if it does not fit, and OverflowError
            for a number too large for a float.
        empty_is_absent: whether "" and [] mean that the field is not set, as in classic clients.
    """

    wanted: str
    parse: Callable[[object], object]
    empty_is_absent: bool = True


@dataclass(frozen=True)
class Field:
    """One field of a request's body."""

    name: str
    kind: Kind
    required: bool = False


def read(body: dict, fields: Iterable[Field], values: dict[str, Any] | None = None) -> dict:
    """Return the values of the fields in a request's body; None for missing ones.

    Args:
        body: the body.
        fields: the fields it may have.
        values: a dict to add the values to. If a field is refused, it holds those before it.

    Raises:
        GymServerError: ``missing_parameter``, ``invalid_parameter``, ``not_supported``.
    """
    values = {} if values is None else values
    for field in fields:
        value = body.get(field.name)
        if value is None or (field.kind.empty_is_absent and value in ("", [])):
            if field.required:
                raise missing_parameter(field.name)
            values[field.name] = None
            continue
        try:
            values[field.name] = field.kind.parse(value)
        except ValueError:
            raise invalid_parameter(field.name, value, field.kind.wanted) from None
        except OverflowError:
            wanted = f"{field.kind.wanted}, with no number above 1e308"
            raise invalid_parameter(field.name, value, wanted) from None
    return values


def integer(value: object) -> int:
    """Read an integer >= 0, which may be written as a float; else raise ValueError.

    Raises OverflowError for an integer too large for a float, as JSON has one kind of number.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError
    if not math.isfinite(value) or value % 1 != 0 or value < 0:
        raise ValueError
    return int(value)


def boolean(value: object) -> bool:
    """Read a flag; some classic clients send a word, 1 or 0. Raise ValueError for others."""
    if isinstance(value, str) and value.lower() in ("true", "false"):
        return value.lower() == "true"
    if isinstance(value, (bool, int, float)) and value in (0, 1):
        return bool(value)
    raise ValueError


def text(value: object) -> str:
    """Read a string; else raise ValueError."""
    if not isinstance(value, str):
        raise ValueError
    return value


def json_object(value: object) -> dict:
    """Read a JSON object; else raise ValueError."""
    if not isinstance(value, dict):
        raise ValueError
    return value


class RequestId(NamedTuple):
    """An idempotency key: identifies a client's request, so that it is done only once.

    Attributes:
        key: the client's own key, 1 to 64 characters.
        number: grows with each request.
    """

    key: str
    number: int


_KEY = re.compile("[!-~]{1,64}")


def _key(value: object) -> str:
    # A header echoes it, which allows only these characters.
    if not isinstance(value, str) or _KEY.fullmatch(value) is None:
        raise ValueError
    return value


def _request_id(value: object) -> RequestId:
    if not isinstance(value, dict):
        raise ValueError
    return RequestId(_key(value.get("key")), integer(value.get("number")))


ANYTHING = Kind("any JSON value", lambda value: value, empty_is_absent=False)
BOOLEAN = Kind("true or false", boolean)
TEXT = Kind("a string", text)
OBJECT = Kind("an object", json_object)
KEY = Kind("1 to 64 visible ASCII characters", _key)
REQUEST_ID = Kind(
    'an object of a "key" (1 to 64 visible ASCII characters) and a "number" (an integer, '
    "0 or greater)",
    _request_id,
)

REQUEST = Field("request", REQUEST_ID)
