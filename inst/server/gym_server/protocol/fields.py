"""The fields of a request: what each may hold, and how it is read."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

from gym_server.errors import invalid_parameter, missing_parameter


@dataclass(frozen=True)
class Kind:
    """What a field may hold.

    Attributes:
        schema: its JSON schema.
        wanted: what it must be, in words that follow "must be".
        parse: turns the JSON value into ours; raises ValueError for what does not fit, and
            OverflowError for a number that is larger than every float.
        empty_is_absent: classic clients send "" or [] for a parameter that they do not set.
    """

    schema: dict
    wanted: str
    parse: Callable[[object], object]
    empty_is_absent: bool = True


@dataclass(frozen=True)
class Field:
    """One field of a request's body."""

    name: str
    kind: Kind
    doc: str
    required: bool = False


def read(body: dict, fields: Iterable[Field], values: dict[str, Any] | None = None) -> dict:
    """Return the fields' values from a request's body; None for those that are absent.

    Args:
        body: the body.
        fields: what it may hold.
        values: takes the values, one after the other: when one is refused, it has those before.

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
    """Return an integer or an integer-valued float as an integer >= 0, else raise ValueError.

    An integer that is larger than every float raises OverflowError: JSON has one kind of numbers.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError
    if not math.isfinite(value) or value % 1 != 0 or value < 0:
        raise ValueError
    return int(value)


def boolean(value: object) -> bool:
    """Return a flag, which may also be a word or 1 or 0, else raise ValueError."""
    if isinstance(value, str) and value.lower() in ("true", "false"):
        return value.lower() == "true"
    if isinstance(value, (bool, int, float)) and value in (0, 1):
        return bool(value)
    raise ValueError


def text(value: object) -> str:
    """Return a string, else raise ValueError."""
    if not isinstance(value, str):
        raise ValueError
    return value


def json_object(value: object) -> dict:
    """Return a JSON object, else raise ValueError."""
    if not isinstance(value, dict):
        raise ValueError
    return value


class RequestId(NamedTuple):
    """An idempotency key: what a client calls one of its requests, so that it is done only once.

    Attributes:
        key: the client's own, 1 to 64 characters.
        number: grows with each of its requests.
    """

    key: str
    number: int


_KEY = re.compile("[!-~]{1,64}")


def _request_id(value: object) -> RequestId:
    key = value.get("key") if isinstance(value, dict) else None
    # It is echoed in a header, where nothing else may stand.
    if not isinstance(value, dict) or not isinstance(key, str) or _KEY.fullmatch(key) is None:
        raise ValueError
    return RequestId(key, integer(value.get("number")))


ANYTHING = Kind({}, "any JSON value", lambda value: value, empty_is_absent=False)
# Also as numbers and words, which some classic clients send.
TRUE_OR_FALSE = (
    {"type": "boolean"},
    {"enum": [0, 1]},
    {"type": "string", "pattern": "^([Tt][Rr][Uu][Ee]|[Ff][Aa][Ll][Ss][Ee])$"},
)
BOOLEAN = Kind({"anyOf": [*TRUE_OR_FALSE]}, "true or false", boolean)
TEXT = Kind({"type": "string"}, "a string", text)
OBJECT = Kind({"type": "object"}, "an object", json_object)
REQUEST_ID = Kind(
    {
        "type": "object",
        "required": ["key", "number"],
        "properties": {
            "key": {"type": "string", "minLength": 1, "maxLength": 64, "pattern": "^[!-~]+$"},
            "number": {"type": "integer", "minimum": 0},
        },
    },
    'an object of a "key" (1 to 64 visible ASCII characters) and a "number" (an integer, '
    "0 or greater)",
    _request_id,
)

REQUEST = Field(
    "request",
    REQUEST_ID,
    "The idempotency key, by which a request is done once however often it arrives: a key of the "
    "client's own, a number that grows. An instance takes 256 keys in a quarter of an hour (429).",
)
