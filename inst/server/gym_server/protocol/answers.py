"""Answers: what a route returns becomes a status, a body of strict JSON or safetensors, headers."""

from __future__ import annotations

import json
import struct
from typing import Any, NamedTuple

import numpy as np

from gym_server.json_values import plain
from gym_server.protocol.fields import REQUEST, RequestId
from gym_server.protocol.safetensors import TENSORS, Parts, Tensor, add_metadata
from gym_server.protocol.safetensors import write as write_tensors

JSON = "application/json"
HTML = "text/html"

_encode = json.JSONEncoder(allow_nan=False, separators=(",", ":")).encode


def dumps(value: object) -> bytes:
    """Return a value as strict JSON; non-finite numbers become strings."""
    try:
        text = _encode(value)
    except (TypeError, ValueError, RecursionError):
        # Only now walk through all of it: an ordinary step has nothing to convert.
        text = _encode(plain(value))
    return text.encode("ascii")


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
