"""The response for an error."""

from __future__ import annotations

from werkzeug.exceptions import MethodNotAllowed

from gym_server.errors import GymServerError, answer_to
from gym_server.protocol.answers import response_to
from gym_server.protocol.fields import RequestId
from gym_server.response import Response


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
