"""What travels: strict JSON both ways, the fields of a request, the shape of an answer."""

from __future__ import annotations

import json
import math
import re
import struct
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from gym_server.api.exactly_once import RequestId
from gym_server.envs.wrappers import Wrapper
from gym_server.errors import GymServerError, invalid_parameter, missing_parameter
from gym_server.json_values import plain
from gym_server.protocol.safetensors import TENSORS, Tensor, add_metadata, malformed_tensors
from gym_server.protocol.safetensors import read as read_tensors
from gym_server.protocol.safetensors import write as write_tensors
from gym_server.spaces import Parts

JSON = "application/json"
HTML = "text/html"

# JSON ---------------------------------------------------------------------------------------

_encode = json.JSONEncoder(allow_nan=False, separators=(",", ":")).encode


def _refuse_constant(name: str) -> object:
    raise ValueError(f'{name} is not JSON (as a string, "{name}", it is)')


# json.loads() would make one each time.
_decode = json.JSONDecoder(parse_constant=_refuse_constant).decode


def dumps(value: object) -> bytes:
    """Return a value as strict JSON; non-finite numbers become strings."""
    try:
        text = _encode(value)
    except (TypeError, ValueError, RecursionError):
        # Only now walk through all of it: an ordinary step has nothing to convert.
        text = _encode(plain(value))
    return text.encode("ascii")


def loads(raw: bytes) -> dict:
    """Return the JSON object in a request's body.

    Args:
        raw: the body; nothing, ``null``, ``""`` and ``[]`` mean an empty object.

    Raises:
        GymServerError: ``malformed_json`` or ``not_an_object``.
    """
    if not raw.strip():
        return {}
    try:
        body = _decode(raw.decode(json.detect_encoding(raw), "surrogatepass"))
    except (ValueError, RecursionError) as error:
        raise GymServerError(
            "malformed_json", f"The request's body is not valid JSON: {error}"
        ) from None
    if body is None or body == "" or body == []:
        return {}
    if not isinstance(body, dict):
        raise GymServerError(
            "not_an_object",
            f"The request's body must be a JSON object, not {_KIND_NAMES[type(body)]}",
        )
    return body


def loads_tensors(raw: bytes) -> dict:
    """Return the fields in a request's body that is a safetensors file.

    Args:
        raw: the body; its metadata holds the other fields as JSON, and the texts by name.

    Returns:
        What ``loads()`` returns, but an action is ``Parts``.

    Raises:
        GymServerError: ``malformed_tensors``.
    """
    file = read_tensors(raw)
    body = {name: _json_metadata(name, text) for name, text in file.metadata.items()}
    texts = body.pop("texts", {})
    if not isinstance(texts, dict) or not all(isinstance(text, str) for text in texts.values()):
        raise malformed_tensors("the metadata 'texts' is no JSON object of texts")
    if any(name.partition("/")[0] == "action" for name in (*file.tensors, *texts)):
        body["action"] = Parts(file.tensors, texts)
    return body


def _json_metadata(name: str, text: str) -> object:
    if name not in _JSON_METADATA:
        return None
    try:
        return _decode(text)
    except (ValueError, RecursionError) as error:
        raise malformed_tensors(f"the metadata {name!r} is not valid JSON: {error}") from None


# Writers such as safetensors' own add texts of theirs ("format": "pt").
_JSON_METADATA = ("render", "request", "step_mask", "texts")

_KIND_NAMES = {
    bool: "a boolean",
    int: "a number",
    float: "a number",
    str: "a string",
    list: "a list",
}


# Fields -------------------------------------------------------------------------------------


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


def read(body: dict, fields: Iterable[Field]) -> dict:
    """Return the fields' values from a request's body; None for those that are absent.

    Raises:
        GymServerError: ``missing_parameter``, ``invalid_parameter``, ``not_supported``.
    """
    values = {}
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


def _boolean(value: object) -> bool:
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


def _object(value: object) -> dict:
    if not isinstance(value, dict):
        raise ValueError
    return value


def _wrappers(value: object) -> tuple[Wrapper, ...]:
    if not isinstance(value, list):
        raise ValueError
    wrappers = [
        Wrapper(
            text(item.get("name")), _object({} if item.get("kwargs") is None else item["kwargs"])
        )
        for item in map(_object, value)
    ]
    return tuple(wrappers)


def _video_callable(value: object) -> int:
    """Return 0 for no videos, n for every n-th episode."""
    if isinstance(value, (bool, str)):
        return int(_boolean(value))
    return integer(value)


# Whatever can be seen on a line of its own, and does not turn the direction of the others.
_NAME = "^[^\\u0000-\\u001f\\u007f-\\u009f\\u200e\\u200f\\u2028-\\u202e\\u2066-\\u2069\\ufeff]*$"
_LONGEST_NAME = 100


def _name(value: object) -> str:
    value = text(value)
    # Half a character is none, and many readers of patterns cannot say so.
    value.encode()
    if len(value) > _LONGEST_NAME or re.fullmatch(_NAME, value) is None:
        raise ValueError
    return value


_KEY = re.compile("[!-~]{1,64}")


def _request_id(value: object) -> RequestId:
    value = _object(value)
    key, number = text(value.get("key")), integer(value.get("number"))
    # It is echoed in a header, where nothing else may stand.
    if _KEY.fullmatch(key) is None:
        raise ValueError
    return RequestId(key, number)


ANYTHING = Kind({}, "any JSON value", lambda value: value, empty_is_absent=False)
ANY_ID = Kind(
    {"type": "string", "examples": ["CartPole-v1", "Pendulum-v1", "MountainCar-v0"]},
    "a string",
    lambda value: value,
)
# Also as numbers and words, which some classic clients send.
_TRUE_OR_FALSE = [
    {"type": "boolean"},
    {"enum": [0, 1]},
    {"type": "string", "pattern": "^([Tt][Rr][Uu][Ee]|[Ff][Aa][Ll][Ss][Ee])$"},
]
BOOLEAN = Kind({"anyOf": _TRUE_OR_FALSE}, "true or false", _boolean)
INTEGER = Kind({"type": "integer", "minimum": 0}, "an integer, 0 or greater", integer)
TEXT = Kind({"type": "string"}, "a string", text)
NAME = Kind(
    {"type": "string", "maxLength": _LONGEST_NAME, "pattern": _NAME},
    f"a text of 1 to {_LONGEST_NAME} printable characters",
    _name,
)
OBJECT = Kind({"type": "object"}, "an object", _object)
WRAPPERS = Kind(
    {
        "type": "array",
        "items": {
            "type": "object",
            "required": ["name"],
            "properties": {"name": {"type": "string"}, "kwargs": {"type": ["object", "null"]}},
        },
    },
    'a list of objects of a "name" and "kwargs"',
    _wrappers,
)
VIDEO_CALLABLE = Kind(
    {"anyOf": [*_TRUE_OR_FALSE, {"type": "integer", "minimum": 0}]},
    "true, false or an integer n for every n-th episode",
    _video_callable,
)
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
    "Names this request, so that it is done once however often it arrives: a key of the client's "
    "own, a number that grows. An instance takes 256 keys in a quarter of an hour (429).",
)


# Answers ------------------------------------------------------------------------------------


class Answer(NamedTuple):
    """An answer as it goes out, and is stored for a repetition."""

    status: int
    body: bytes
    content_type: str = JSON
    headers: tuple[tuple[str, str], ...] = ()


class Content(NamedTuple):
    """A result that is bytes already."""

    data: bytes
    content_type: str
    status: int = 200
    headers: tuple[tuple[str, str], ...] = ()


class Ready(NamedTuple):
    """The body of a reset's or a step's answer, to which only the request is to be added."""

    body: bytes
    content_type: str


def answer(
    result: dict | Content | Ready | None, request_id: RequestId | None, status: int = 200
) -> Answer:
    """Put a route's result into an answer.

    Args:
        result: a JSON object, whose observations may be tensors, a content of its own, a body
            that is ready, or None for an answer without content (204).
        request_id: what the client called its request, echoed when given.
        status: the HTTP status of a JSON answer.
    """
    if isinstance(result, Content):
        return Answer(result.status, result.data, result.content_type, result.headers)
    if isinstance(result, Ready):
        return Answer(status, _with_request(result, request_id), result.content_type)
    if result is None:
        headers = () if request_id is None else (("Gym-Request", "{} {}".format(*request_id)),)
        # Strictly typed classic clients expect Flask's default type here.
        return Answer(204, b"", "text/html; charset=utf-8", headers)
    if request_id is not None:
        result = {**result, "request": request_id._asdict()}
    if isinstance(result.get("observation"), Parts):
        return Answer(status, _dumps_tensors(**result), TENSORS)
    return Answer(status, dumps(result))


def _with_request(ready: Ready, request_id: RequestId | None) -> bytes:
    if request_id is None:
        return ready.body
    request = dumps(request_id._asdict())
    if ready.content_type == TENSORS:
        return add_metadata(ready.body, REQUEST.name, request.decode("ascii"))
    return b'%b,"request":%b}' % (ready.body[:-1], request)


def _dumps_tensors(observation: Parts, final_obs: Parts | None = None, **others: Any) -> bytes:
    """Return a reset's or a step's result as a safetensors file."""
    tensors, texts = dict(observation.tensors), dict(observation.texts)
    if final_obs is not None:
        tensors.update(final_obs.tensors)
        texts.update(final_obs.texts)
    for name, of_scalar in _SCALARS.items():
        value = others.get(name)
        if value is not None:
            is_array = isinstance(value, np.ndarray)
            tensors[name] = Tensor.of(value) if is_array else of_scalar(value)
    metadata = {name: others[name] for name in _METADATA if name in others}
    if texts:
        metadata["texts"] = texts
    return write_tensors(
        tensors, {name: dumps(value).decode("ascii") for name, value in metadata.items()}
    )


def _flag(value: bool) -> Tensor:
    return Tensor("BOOL", (), b"\1" if value else b"\0")


# What an answer holds beside the observation; done is one of the two flags. With sub-environments
# they are arrays already.
_SCALARS = {
    "reward": lambda value: Tensor("F64", (), struct.pack("<d", value)),
    "terminated": _flag,
    "truncated": _flag,
}

_METADATA = ("info", "request", "final_sub_envs")


def parse_path_value(text: str) -> object:
    """Return a value that stands in a URL: JSON where it is JSON, else the text itself."""
    try:
        return _decode(text)
    except (ValueError, RecursionError):
        return text
