"""Request bodies: strict JSON and safetensors."""

from __future__ import annotations

import json
from collections.abc import Collection

from gym_server.errors import GymServerError
from gym_server.protocol.safetensors import Parts, malformed_tensors
from gym_server.protocol.safetensors import read as read_tensors


def _refuse_constant(name: str) -> object:
    raise ValueError(f'{name} is not JSON (as a string, "{name}", it is)')


# Parsing holds the GIL, and no other call is answered meanwhile. This many bytes take 20 ms and
# become up to 25 MiB of objects. Larger arrays are sent as tensors.
_LARGEST_JSON = 2**20

# json.loads() would create a decoder for each call.
_decode = json.JSONDecoder(parse_constant=_refuse_constant).decode


def loads(raw: bytes) -> dict:
    """Return the JSON object in a request's body.

    Args:
        raw: the body; an empty body, ``null``, ``""`` and ``[]`` mean an empty object.

    Raises:
        GymServerError: ``body_too_large``, ``malformed_json`` or ``not_an_object``.
    """
    if len(raw) > _LARGEST_JSON:
        raise GymServerError(
            "body_too_large",
            f"A JSON body may have at most {_LARGEST_JSON:,} bytes, not {len(raw):,}",
            "send arrays as tensors, in a safetensors file",
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


def loads_tensors(raw: bytes, names: Collection[str]) -> dict:
    """Return the fields of a request whose body is a safetensors file.

    Args:
        raw: the body; its metadata holds fields as JSON, and the texts by name.
        names: the fields. Other metadata are ignored: writers such as safetensors' own library add
            texts.

    Returns:
        The same as ``loads()``, except that an action is ``Parts``; and all ``tensors``.

    Raises:
        GymServerError: ``malformed_tensors``.
    """
    file = read_tensors(raw)
    known = [name for name in file.metadata if name in names or name == "texts"]
    body = {name: _json_text(name, file.metadata[name]) for name in known}
    texts = body.pop("texts", {})
    if not isinstance(texts, dict) or not all(isinstance(text, str) for text in texts.values()):
        raise malformed_tensors("the metadata 'texts' is not a JSON object of texts")
    if any(name.partition("/")[0] == "action" for name in (*file.tensors, *texts)):
        body["action"] = Parts(file.tensors, texts)
    return {**body, "tensors": file.tensors}


def _json_text(name: str, text: str) -> object:
    try:
        return _decode(text)
    except (ValueError, RecursionError) as error:
        raise malformed_tensors(f"the metadata {name!r} is not valid JSON: {error}") from None


_KIND_NAMES = {
    bool: "a boolean",
    int: "a number",
    float: "a number",
    str: "a string",
    list: "a list",
}


def parse_path_value(text: str) -> object:
    """Return a value from a URL: parsed if it is JSON, otherwise the text itself."""
    try:
        return _decode(text)
    except (ValueError, RecursionError):
        return text
