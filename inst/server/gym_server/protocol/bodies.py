"""The bodies of requests: strict JSON, and safetensors."""

from __future__ import annotations

import json

from gym_server.errors import GymServerError
from gym_server.protocol import known_headers
from gym_server.protocol.safetensors import Parts, malformed_tensors
from gym_server.protocol.safetensors import read as read_tensors


def _refuse_constant(name: str) -> object:
    raise ValueError(f'{name} is not JSON (as a string, "{name}", it is)')


# Parsing holds the interpreter, so that nobody else is answered meanwhile: 20 ms for so many bytes,
# which become up to 25 MiB of objects. Arrays of any size are sent as tensors.
_LARGEST_JSON = 2**20

# json.loads() would make one each time.
_decode = json.JSONDecoder(parse_constant=_refuse_constant).decode


def loads(raw: bytes) -> dict:
    """Return the JSON object in a request's body.

    Args:
        raw: the body; nothing, ``null``, ``""`` and ``[]`` mean an empty object.

    Raises:
        GymServerError: ``body_too_large``, ``malformed_json`` or ``not_an_object``.
    """
    if len(raw) > _LARGEST_JSON:
        raise GymServerError(
            "body_too_large",
            f"A request's body of JSON may have {_LARGEST_JSON:,} bytes, not {len(raw):,}",
            "arrays may be sent as tensors, in a safetensors file",
        )
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
    return known_headers.read(raw, _parse_tensors)


def _parse_tensors(raw: bytes) -> dict:
    file = read_tensors(raw)
    body = {name: _json_metadata(name, text) for name, text in file.metadata.items()}
    texts = body.pop("texts", {})
    if not isinstance(texts, dict) or not all(isinstance(text, str) for text in texts.values()):
        raise malformed_tensors("the metadata 'texts' is no JSON object of texts")
    if any(name.partition("/")[0] == "action" for name in (*file.tensors, *texts)):
        body["action"] = Parts(file.tensors, texts)
    return body


def loads_file(raw: bytes) -> dict:
    """Return the fields in a body that is a safetensors file, and its tensors as ``tensors``.

    Raises:
        GymServerError: ``malformed_tensors``.
    """
    file = read_tensors(raw)
    body: dict = {}
    for name, text in file.metadata.items():
        # Writers such as safetensors' own add texts of theirs.
        if name != "format":
            body[name] = _json_text(name, text)
    return {**body, "tensors": file.tensors}


def _json_metadata(name: str, text: str) -> object:
    return _json_text(name, text) if name in _JSON_METADATA else None


def _json_text(name: str, text: str) -> object:
    try:
        return _decode(text)
    except (ValueError, RecursionError) as error:
        raise malformed_tensors(f"the metadata {name!r} is not valid JSON: {error}") from None


# Writers such as safetensors' own add texts of theirs ("format": "pt").
_JSON_METADATA = ("final_obs", "info", "render", "request", "step_mask", "texts")

_KIND_NAMES = {
    bool: "a boolean",
    int: "a number",
    float: "a number",
    str: "a string",
    list: "a list",
}


def parse_path_value(text: str) -> object:
    """Return a value that stands in a URL: JSON where it is JSON, else the text itself."""
    try:
        return _decode(text)
    except (ValueError, RecursionError):
        return text
