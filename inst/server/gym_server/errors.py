"""What can go wrong, by code, and the one place where an exception becomes an answer."""

from __future__ import annotations

import logging
import traceback

from werkzeug.exceptions import HTTPException

from gym_server.plain import brief

log = logging.getLogger(__name__)

# Every other code answers with 400, as the classic server did.
_STATUS = {
    "unauthorized": 401,
    "foreign_host": 403,
    "foreign_origin": 403,
    "shutdown_disabled": 403,
    "not_found": 404,
    "method_not_allowed": 405,
    "request_conflict": 409,
    "upload_closed": 410,
    "body_too_large": 413,
    "environment_error": 500,
    "internal_error": 500,
    "shutting_down": 503,
}

_HEADERS = {"unauthorized": (("WWW-Authenticate", 'Bearer realm="gym_server"'),)}


class GymServerError(Exception):
    """A call that cannot be served.

    Attributes:
        code: stable name of what is wrong, snake_case.
        message: one sentence for a person.
        hint: what to do about it, or None.
        extra: the extra of the server that is missing, or None.
    """

    def __init__(
        self, code: str, message: str, hint: str | None = None, extra: str | None = None
    ) -> None:
        super().__init__(message)
        self.code = code
        self.message = message
        self.hint = hint
        self.extra = extra

    @property
    def status(self) -> int:
        """The HTTP status of the answer."""
        return _STATUS.get(self.code, 400)

    @property
    def headers(self) -> tuple[tuple[str, str], ...]:
        """What else the answer's head says."""
        return _HEADERS.get(self.code, ())


def unknown_instance(instance_id: str) -> GymServerError:
    """No environment has this instance_id, or it was closed."""
    return GymServerError("unknown_instance", f"Instance_id {instance_id} unknown")


def shutdown_disabled() -> GymServerError:
    """The operator did not want clients to stop the server."""
    return GymServerError("shutdown_disabled", "Clients cannot stop this server")


def shutting_down() -> GymServerError:
    """The server takes nothing more."""
    return GymServerError("shutting_down", "The server is stopping")


def missing_parameter(name: str) -> GymServerError:
    """A required field is absent or empty (the classic server's words)."""
    return GymServerError(
        "missing_parameter", f"A required request parameter '{name}' was not provided"
    )


def invalid_parameter(name: str, value: object, wanted: str) -> GymServerError:
    """A field holds something that it cannot mean."""
    return GymServerError(
        "invalid_parameter", f"The parameter '{name}' must be {wanted}, not {brief(value)}"
    )


def wrong_length(name: str, found: int, lanes: int, what: str) -> GymServerError:
    """A list has not one entry for each lane."""
    return GymServerError(
        "invalid_parameter",
        f"The parameter '{name}' must hold one {what} for each of the {lanes} lanes, not {found}",
    )


def reset_needed(call: str) -> GymServerError:
    """A call needs an episode, and none runs."""
    return GymServerError(
        "reset_needed", f"{call} needs a running episode", "reset the environment first"
    )


def environment_error(error: BaseException) -> GymServerError:
    """Wrap what an environment's own code raised."""
    last_line = traceback.format_exception_only(type(error), error)[-1].strip()
    return GymServerError("environment_error", f"The environment raised {last_line}")


def answer_to(error: BaseException) -> tuple[int, dict[str, str]]:
    """Turn any exception into a status and the body of the answer.

    Args:
        error: a GymServerError, one of werkzeug's HTTP errors, or a fault of our own, which
            is logged.

    Returns:
        The HTTP status and ``{"message", "code", "hint"?, "extra"?}``.
    """
    if isinstance(error, HTTPException):
        error = _from_http(error)
    elif not isinstance(error, GymServerError):
        log.error("A fault of the server's own", exc_info=error)
        error = GymServerError(
            "internal_error",
            f"The server failed: {type(error).__name__}: {error}",
            "this is a fault of gym_server; the server's log has the details",
        )
    elif error.code == "environment_error":
        log.warning("%s", error.message, exc_info=error)
    body = {"message": error.message, "code": error.code}
    if error.hint:
        body["hint"] = error.hint
    if error.extra:
        body["extra"] = error.extra
    return error.status, body


def _from_http(error: HTTPException) -> GymServerError:
    match error.code:
        case 404:
            return GymServerError(
                "not_found", "There is nothing at this URL", "GET /v1/openapi.json lists the routes"
            )
        case 405:
            allowed = ", ".join(sorted(getattr(error, "valid_methods", None) or ()))
            return GymServerError(
                "method_not_allowed", "This URL does not take that method", f"use {allowed}"
            )
        case 413:
            return GymServerError(
                "body_too_large",
                "The request's body is larger than this server takes",
                "the server's option --max-body-mb sets the limit",
            )
        case _:
            return GymServerError("malformed_json", f"The request cannot be read: {error}")
