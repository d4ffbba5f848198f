"""Errors by code, and the one place that turns an exception into a response."""

from __future__ import annotations

import errno
import logging
import traceback

from werkzeug.exceptions import HTTPException

from gym_server.json_values import LONGEST_MESSAGE, brief, shortened
from gym_server.logs import warn_once

log = logging.getLogger(__name__)

# All other codes have status 400, as on the classic server.
_STATUS = {
    "unauthorized": 401,
    "foreign_host": 403,
    "foreign_origin": 403,
    "not_found": 404,
    "method_not_allowed": 405,
    "request_conflict": 409,
    "instance_idle_closed": 410,
    "upload_closed": 410,
    "body_too_large": 413,
    "upgrade_required": 426,
    "too_many_instances": 429,
    "too_many_rollouts": 429,
    "too_many_sub_envs": 429,
    "too_many_processes": 429,
    "too_much_memory": 429,
    "environment_died": 500,
    "environment_error": 500,
    "internal_error": 500,
    "shutting_down": 503,
    "call_too_long": 504,
}

_HEADERS = {
    "too_many_rollouts": (("Retry-After", "1"),),
    "upgrade_required": (("Upgrade", "websocket"), ("Sec-WebSocket-Version", "13")),
    "unauthorized": (("WWW-Authenticate", 'Bearer realm="gym_server"'),),
}

# Errors below 500 that may come after some work was done. Errors from 500 on always may.
_AFTER_SOMETHING_WAS_DONE = frozenset(
    {"missing_dependency", "monitor_directory", "too_much_memory"}
)

# In the log, in characters: an error may repeat everything that a client sent.
_LONGEST_TRACEBACK = 20_000

# For people: describes the routes. The classic R client shows no error message without this field.
_DOCUMENTATION = "https://github.com/openai/gym-http-api#api-specification"


# What Python, MuJoCo and SDL say in exceptions of other classes if there is no more memory.
_NO_MEMORY = ("can't start new thread", "Could not allocate memory", "Out of memory")


class GymServerError(Exception):
    """A call that the server cannot or will not carry out.

    Attributes:
        code: a stable name of the problem, snake_case.
        message: one sentence for a person.
        hint: how to fix it, or None.
        extra: the server's extra that is missing, or None.
        is_logged: whether the process that raised it has already logged it.
    """

    is_logged = False

    def __init__(
        self, code: str, message: str, hint: str | None = None, extra: str | None = None
    ) -> None:
        # An environment's message may repeat everything that a client sent.
        self.message = shortened(message, LONGEST_MESSAGE)
        super().__init__(self.message)
        self.code = code
        self.hint = hint and shortened(hint, LONGEST_MESSAGE)
        self.extra = extra

    @property
    def status(self) -> int:
        """The HTTP status of the response."""
        return _STATUS.get(self.code, 400)

    @property
    def did_nothing(self) -> bool:
        """Whether it was raised before anything changed."""
        return self.status < 500 and self.code not in _AFTER_SOMETHING_WAS_DONE

    def again(self) -> GymServerError:
        """Return a copy to raise: raising the same error again lengthens its traceback."""
        return GymServerError(self.code, self.message, self.hint, self.extra)

    def __reduce__(self) -> tuple:
        # What was raised in another process, from which it comes as a pickle, was logged there.
        parts = self.code, self.message, self.hint, self.extra
        return GymServerError, parts, {"is_logged": True}

    @property
    def headers(self) -> tuple[tuple[str, str], ...]:
        """Additional headers of the response."""
        return _HEADERS.get(self.code, ())


def unknown_instance(instance_id: str) -> GymServerError:
    """Report an instance_id that no environment has, or no longer has."""
    return GymServerError("unknown_instance", f"Instance_id {instance_id} unknown")


def idle_closed(instance_id: str, env_id: str, minutes: float) -> GymServerError:
    """Report an instance that the server closed because nobody used it."""
    return GymServerError(
        "instance_idle_closed",
        f"Instance {instance_id} of {env_id} was closed: nobody used it for {minutes:g} minutes",
        "create it again; the server's option --idle-minutes sets the limit",
    )


def lacks_memory(error: BaseException) -> bool:
    """Return whether an exception says that the system gives no more memory or threads."""
    if isinstance(error, OSError):
        return error.errno == errno.ENOMEM
    return isinstance(error, MemoryError) or str(error).endswith(_NO_MEMORY)


def too_much_memory(error: BaseException, who: str = "The server") -> GymServerError:
    """Report that the system gave no more memory; see ``lacks_memory()``.

    Frees what the functions that failed hold in their variables, because the answer needs memory.
    """
    traceback.clear_frames(error.__traceback__)
    return GymServerError(
        "too_much_memory",
        f"{who} needs more memory than it may have ({_last_line(error)})",
        "make fewer or smaller environments; the server's option --max-memory-mb sets the limit",
    )


def call_too_long(seconds: float) -> GymServerError:
    """Report a call in an environment's process that took longer than the server allows."""
    return GymServerError(
        "call_too_long",
        f"A call took more than {seconds:g} seconds, so the environment's process was ended",
        "create another; the server's option --max-call-seconds sets the limit",
    )


def shutting_down() -> GymServerError:
    """Report that the server is stopping and accepts no more calls."""
    return GymServerError("shutting_down", "The server is stopping")


def missing_parameter(name: str) -> GymServerError:
    """Report a required field that is missing or empty, in the classic server's words."""
    return GymServerError(
        "missing_parameter", f"A required request parameter '{name}' was not provided"
    )


def invalid_parameter(name: str, value: object, wanted: str) -> GymServerError:
    """Report a field with a value that is not allowed."""
    return GymServerError(
        "invalid_parameter", f"The parameter '{name}' must be {wanted}, not {brief(value)}"
    )


def invalid_policy(problem: str, fix: str | None = None) -> GymServerError:
    """Report a policy that is malformed or does not fit the environment's spaces."""
    return GymServerError("invalid_policy", problem, fix)


def wrong_length(name: str, found: int, num_envs: int, what: str) -> GymServerError:
    """Report a list whose length is not the number of sub-environments."""
    return GymServerError(
        "invalid_parameter",
        f"The parameter '{name}' must hold one {what} for each of the {num_envs} "
        f"sub-environments, not {found}",
    )


def reset_needed(call: str) -> GymServerError:
    """Report a call that needs a running episode when there is none."""
    return GymServerError(
        "reset_needed", f"{call} needs a running episode", "reset the environment first"
    )


def environment_error(error: BaseException, who: str = "The environment") -> GymServerError:
    """Wrap an exception from an environment's own code."""
    if lacks_memory(error):
        return too_much_memory(error, who)
    return GymServerError("environment_error", f"{who} raised {_last_line(error)}")


def _last_line(error: BaseException) -> str:
    return traceback.format_exception_only(type(error), error)[-1].strip()


def environment_died(how: str, doing: str) -> GymServerError:
    """Report that a process of an environment ended unexpectedly."""
    return GymServerError(
        "environment_died",
        f"The environment's process ended {doing}: {how}",
        "it is closed, and the others continue; create another",
    )


def malformed_request(reason: str) -> GymServerError:
    """Report bytes that are not a valid request."""
    return GymServerError("malformed_json", f"The request cannot be read: {reason}")


def body_too_large() -> GymServerError:
    """Report a body that is too large."""
    return GymServerError(
        "body_too_large",
        "The request's body is larger than this server accepts",
        "send less at a time",
    )


def logged(error: BaseException) -> GymServerError:
    """Turn any exception into an error of the server; log what an administrator may want to see.

    Args:
        error: a GymServerError, one of werkzeug's HTTP errors, or a bug in the server.
    """
    if isinstance(error, HTTPException):
        error = _from_http(error)
    elif lacks_memory(error):
        error = too_much_memory(error)
        log.warning("%s", error.message)
    elif not isinstance(error, GymServerError):
        log.error("A bug in the server", exc_info=error)
        error = GymServerError(
            "internal_error",
            f"The server failed: {type(error).__name__}: {error}",
            "this is a bug in gym_server; the server's log has the details",
        )
    elif error.code in ("environment_error", "too_much_memory") and not error.is_logged:
        trace = "".join(traceback.format_exception(error)).rstrip()
        warn_once(__name__, shortened(f"{error.message}\n{trace}", _LONGEST_TRACEBACK))
    return error


def answer_to(error: BaseException) -> tuple[int, dict[str, str]]:
    """Turn any exception into a status and a response body; see ``logged()``.

    Returns:
        The HTTP status and ``{"message", "code", "documentation_url", "hint"?, "extra"?}``.
    """
    error = logged(error)
    body = {
        "message": error.message,
        "code": error.code,
        "documentation_url": _DOCUMENTATION,
    }
    if error.hint:
        body["hint"] = error.hint
    if error.extra:
        body["extra"] = error.extra
    return error.status, body


def _from_http(error: HTTPException) -> GymServerError:
    match error.code:
        case 404:
            return GymServerError(
                "not_found", "There is nothing at this URL", "PROTOCOL.md lists the routes"
            )
        case 405:
            allowed = ", ".join(sorted(getattr(error, "valid_methods", None) or ()))
            return GymServerError(
                "method_not_allowed", "This URL does not take that method", f"use {allowed}"
            )
        case 413:
            return body_too_large()
        case _:
            return malformed_request(str(error))
