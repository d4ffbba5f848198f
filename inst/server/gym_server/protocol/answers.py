"""Turn a route's result into a response with a body of strict JSON or safetensors."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from werkzeug.exceptions import MethodNotAllowed

from gym_server.errors import GymServerError, answer_to
from gym_server.json_values import plain
from gym_server.protocol.fields import RequestId
from gym_server.protocol.safetensors import (
    COLUMN_TENSORS,
    TENSORS,
    Parts,
    Tensor,
    quoted,
    write,
)
from gym_server.protocol.safetensors import join as join_tensors
from gym_server.response import Response

HTML = "text/html"

_encode = json.JSONEncoder(allow_nan=False, separators=(",", ":")).encode


def dumps(value: object) -> bytes:
    """Encode a value as strict JSON; non-finite numbers become strings."""
    try:
        text = _encode(value)
    except (TypeError, ValueError, RecursionError):
        # Convert only now: the result of an ordinary step needs no conversion.
        text = _encode(plain(value))
    return text.encode("ascii")


class AnswerForm(NamedTuple):
    """What the response to a reset or step contains, and in which format.

    Attributes:
        tensors: whether observations are tensors, if their space allows it.
        by_column: whether tensors are transposed, see ``COLUMN_TENSORS``.
        infos: whether infos are included; otherwise the response has an empty one.
        finals: whether the last observations of episodes that were reset automatically are
            included.
    """

    tensors: bool = False
    by_column: bool = False
    infos: bool = True
    finals: bool = True


JSON_FORM = AnswerForm()


def tensor_response(
    arrays: Mapping[str, np.ndarray], metadata: Mapping[str, str], by_column: bool
) -> Response:
    """Return arrays and metadata as a response."""
    tensors = {name: Tensor.of(array, by_column) for name, array in arrays.items()}
    return Response(200, write(tensors, metadata), COLUMN_TENSORS if by_column else TENSORS)


def response_to(
    result: dict | Response | None, request_id: RequestId | None, status: int = 200
) -> Response:
    """Turn a route's result into a response.

    Args:
        result: a JSON object, whose observations may be tensors; a finished response; or
            None for no content (204).
        request_id: the client's idempotency key, echoed if given.
        status: the HTTP status of a JSON object.
    """
    if isinstance(result, Response):
        return result
    if result is None:
        headers = () if request_id is None else (("Gym-Request", "{} {}".format(*request_id)),)
        # Strictly typed classic clients expect Flask's default content type here.
        return Response(204, b"", "text/html; charset=utf-8", headers)
    if isinstance(observation := result.get("observation"), Parts):
        content_type = COLUMN_TENSORS if observation.by_column else TENSORS
        return Response(status, _dumps_tensors(request_id, **result), content_type)
    if request_id is not None:
        result = {**result, "request": request_id._asdict()}
    return Response(status, dumps(result))


def failure(error: BaseException, request_id: RequestId | None = None) -> Response:
    """Return the response for an error."""
    status, body = answer_to(error)
    response = response_to(body, request_id, status)
    if isinstance(error, GymServerError):
        return response._replace(headers=error.headers)
    if isinstance(error, MethodNotAllowed):
        allowed = ", ".join(sorted(error.valid_methods or ()))
        return response._replace(headers=(("Allow", allowed),))
    return response


def _dumps_tensors(
    request_id: RequestId | None, observation: Parts, final_obs: Parts | None = None, **others: Any
) -> bytes:
    """Encode the result of a reset or step as a safetensors file."""
    tensors, texts = dict(observation.tensors), dict(observation.texts)
    if final_obs is not None:
        tensors.update(final_obs.tensors)
        texts.update(final_obs.texts)
    # "done" is left out: it is terminated or truncated. With sub-environments these are arrays.
    reward = others.get("reward")
    if isinstance(reward, np.ndarray):
        for name in ("reward", "terminated", "truncated"):
            tensors[name] = Tensor.of(others[name])
    elif reward is not None:
        tensors["reward"] = Tensor("F64", (), struct.pack("<d", reward))
        tensors["terminated"] = FLAGS[others["terminated"]]
        tensors["truncated"] = FLAGS[others["truncated"]]
    metadata = [_metadata("info", others["info"])]
    if request_id is not None:
        metadata.append(_request_metadata(request_id))
    if "final_sub_envs" in others:
        metadata.append(_metadata("final_sub_envs", others["final_sub_envs"]))
    if texts:
        metadata.append(_metadata("texts", texts))
    return join_tensors(tensors, b",".join(metadata))


def _metadata(name: str, value: object) -> bytes:
    """Return a value as metadata. Metadata values are texts, so this is JSON inside JSON."""
    if value == {}:
        return b'"%b":"{}"' % name.encode("ascii")
    return quoted({name: dumps(value).decode("ascii")})


def _request_metadata(request_id: RequestId) -> bytes:
    return b'%b%d}"' % (_request_beginning(request_id.key), request_id.number)


# A client has one key and numbers its requests.
@lru_cache(maxsize=256)
def _request_beginning(key: str) -> bytes:
    """Return the metadata that echo a key, up to the number."""
    return _metadata("request", {"key": key, "number": 0})[: -len(b'0}"')]


FLAGS = {False: Tensor("BOOL", (), b"\0"), True: Tensor("BOOL", (), b"\1")}
