"""The Flask application."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field
from hashlib import blake2b
from http import HTTPStatus
from pathlib import Path
from typing import NamedTuple

from flask import Flask, Response, request
from werkzeug.datastructures import MIMEAccept, MultiDict
from werkzeug.exceptions import MethodNotAllowed
from werkzeug.http import parse_accept_header

from gym_server.api import watch_routes
from gym_server.api.access import Access, Guard
from gym_server.api.exactly_once import ExactlyOnce, Outcome, RequestId
from gym_server.api.routes import (
    ROUTES,
    Call,
    Route,
    Services,
    env_close,
    env_delete,
    env_reset,
    env_step,
)
from gym_server.api.watch_keys import WatchKeys
from gym_server.envs.allowed_paths import AllowedPaths
from gym_server.errors import GymServerError, answer_to, shutdown_disabled
from gym_server.isolation.policy import Isolation
from gym_server.manager.instance_manager import InstanceManager
from gym_server.manager.limits import Limits, Watchers
from gym_server.manager.watchdog import Watchdog
from gym_server.monitoring.monitor_directory import MonitorRoot
from gym_server.protocol import wire
from gym_server.protocol.safetensors import TENSORS
from gym_server.protocol.wire import Answer
from gym_server.rendering.render_thread import RenderThread

# The routes of each step; the id is one that an instance can have.
_HOT = re.compile("/v1/envs/([0-9a-f]+)/(reset|step)/?")
_WATCH_PAGE = re.compile("/v1/envs/[0-9a-f]+/watch/?")

# As much as the answers that are kept beside it; a digest of it takes 40 us.
_KEPT_BYTES = 2**16


@dataclass(frozen=True)
class Config:
    """How a server is set up.

    Attributes:
        monitor_dir: monitors write below it; None for a fresh temporary directory.
        temporary_monitors: whether they may also write below the system's temporary directory.
        allowed_modules: names of the modules that an env_id may import.
        max_body_bytes: the size of the largest request.
        limits: how much of everything there is for all clients together.
        isolate: which environments get a process of their own: "none", "foreign" (those of
            other modules than Gymnasium's and ale_py's) or "all".
        max_worker_mb: how much memory such a process may have, in MiB; 0 for no limit.
        stop: asks the server to stop once the requests under way are answered.
        access: whom the server lets in.
        client_stop: whether clients may stop it.
        allowed_paths: directories that kwargs may name paths in; None for any path.
    """

    monitor_dir: Path | None = None
    temporary_monitors: bool = True
    allowed_modules: Collection[str] = ()
    max_body_bytes: int = 16 * 2**20
    limits: Limits = field(default_factory=Limits)
    isolate: str = "foreign"
    max_worker_mb: int = 0
    stop: Callable[[], None] = lambda: None
    access: Access = field(default_factory=Access)
    client_stop: bool = True
    allowed_paths: Collection[Path] | None = None


class GymApp(Flask):
    """The application, with what it has to put in order at the end.

    Attributes:
        answer_for: sends a status, headers and a body on behalf of a thread that is stuck in an
            environment, to the client that it serves; set by what has the connections.
    """

    answer_for: Callable[[int, str, list[tuple[str, str]], bytes], None]

    def __init__(self, config: Config) -> None:
        """Set up the services and the routes."""
        super().__init__("gym_server", static_folder=None)
        self.config["MAX_CONTENT_LENGTH"] = config.max_body_bytes
        self._renderer = RenderThread()
        self._monitor_root = MonitorRoot(config.monitor_dir, config.temporary_monitors)
        self._instances = InstanceManager(
            config.allowed_modules,
            self._renderer,
            config.limits,
            Isolation(config.isolate, config.max_worker_mb),
            AllowedPaths(config.allowed_paths),
        )
        watch_keys = WatchKeys()
        self._guard = Guard(config.access, watch_keys)
        services = Services(
            self._instances,
            self._monitor_root,
            config.stop if config.client_stop else _refuse_to_stop,
            Watchers(config.limits.max_watchers),
            watch_keys if config.access.token is not None else None,
        )
        exactly_once: ExactlyOnce[Answer] = ExactlyOnce(self._instances.lives, _kept_bytes)
        self._exactly_once = exactly_once
        self._hot_handlers: dict[str, _Handler] = {}
        for route in ROUTES:
            handler = _Handler(route, services, exactly_once)
            self.add_url_rule(
                route.path,
                endpoint=route.handler.__name__,
                view_func=_view(handler),
                methods=[route.method],
                provide_automatic_options=False,
                strict_slashes=False,
            )
            if route.handler in (env_reset, env_step):
                self._hot_handlers[route.path.split("/")[-2]] = handler
        self.register_error_handler(Exception, lambda error: _response(_failure(error, None)))
        self.answer_for = lambda *_: None
        self._watchdog = Watchdog(
            self._instances, config.limits, self._give_up, exactly_once.forget_in_time
        )

    def wsgi_app(self, environ: dict, start_response: Callable) -> Iterable[bytes]:
        """Answer by WSGI, resets and steps without Flask's dispatch: it takes longer than they."""
        try:
            self._guard.check(environ)
        except GymServerError as refusal:
            return _send(_turn_away(refusal, environ), start_response)
        hot = _HOT.fullmatch(environ["PATH_INFO"])
        length = environ.get("CONTENT_LENGTH", "")
        if not (
            hot
            and environ["REQUEST_METHOD"] == "POST"
            and length.isdecimal()
            and int(length) <= self.config["MAX_CONTENT_LENGTH"]
        ):
            return super().wsgi_app(environ, start_response)
        request = _Request(
            "POST",
            hot[0],
            {"instance_id": hot[1]},
            {},
            environ["wsgi.input"].read(int(length)),
            environ.get("CONTENT_TYPE", ""),
            environ.get("HTTP_ACCEPT", ""),
        )
        return _send(self._hot_handlers[hot[2]].answer(request), start_response)

    def admit(self, environ: dict) -> None:
        """Raise the refusal of a request that would not be answered, before its body has come."""
        self._guard.check(environ)

    def knows(self, environ: dict) -> bool:
        """Tell whether a request comes from one who may talk to this server at all."""
        return self._guard.knows(environ)

    def _give_up(self, thread: int, why: GymServerError) -> None:
        """Answer what a thread does that is stuck in an environment."""
        answer = self._exactly_once.give_up(thread, lambda number: _failure(why, number))
        answer = answer or _failure(why, None)
        self.answer_for(thread, *_head(answer), answer.body)

    def end_watching(self) -> None:
        """Send all watchers away, who would wait for more than the server's last moment."""
        self._instances.end_watching()

    def close(self) -> None:
        """Close every environment and monitor."""
        self._watchdog.stop()
        self._instances.close_all()
        self._renderer.stop()
        self._monitor_root.close()


def create_app(config: Config | None = None) -> GymApp:
    """Return the application; call its ``close()`` at the end."""
    return GymApp(config or Config())


class _Request(NamedTuple):
    """What the protocol needs to know of an HTTP request."""

    method: str
    path: str
    variables: dict[str, str]
    query: dict[str, str | list[str]]
    body: bytes
    content_type: str
    accept: str


class _Handler:
    """Answers the requests to one route, however they came here."""

    def __init__(self, route: Route, services: Services, exactly_once: ExactlyOnce[Answer]) -> None:
        self.route = route
        self._services = services
        self._exactly_once = exactly_once

    def answer(self, request: _Request) -> Answer:
        """Answer a request; whatever goes wrong is an answer, too."""
        try:
            return self._answer(request)
        except Exception as error:
            return _failure(error, None)

    def _answer(self, request: _Request) -> Answer:
        route = self.route
        sends_tensors = route.tensor_body and TENSORS in request.content_type
        if route.method == "GET":
            body = request.query
        else:
            body = wire.loads_tensors(request.body) if sends_tensors else wire.loads(request.body)
        wants_tensors = route.tensors and _prefers_tensors(request.accept, route.content_type)
        request_id = wire.read(body, (wire.REQUEST,))["request"] if route.once else None

        instance_id = request.variables.get("instance_id")
        # What ends an instance is known as what makes one is, by key and number: it is never one
        # key too many.
        moved_id = None if route.handler in (env_close, env_delete) else instance_id

        def perform() -> Outcome:
            try:
                fields = wire.read(body, route.fields)
                call = Call(
                    self._services,
                    request.variables,
                    body,
                    fields,
                    wants_tensors,
                    request.path,
                    request.accept,
                )
                result = route.handler(call)
                answer = wire.answer(result, request_id)
                return Outcome(answer, True, instance_id or _made(result))
            except BaseException as error:
                # What an environment raises must not pass by the answer that is stored.
                did_nothing = isinstance(error, GymServerError) and error.did_nothing
                return Outcome(_failure(error, request_id), not did_nothing, instance_id)

        if request_id is None:
            return perform().answer
        content = (request.path, _fingerprint(request.body), sends_tensors, wants_tensors)
        try:
            return self._exactly_once.answer(request_id, moved_id, content, perform)
        except Exception as error:
            return _failure(error, request_id)


def _fingerprint(body: bytes) -> bytes:
    """Return what a repetition is known by: a digest where the body is too long to keep."""
    return body if len(body) <= _KEPT_BYTES else blake2b(body).digest()


def _made(result: object) -> str | None:
    """Return the instance that a route without one made."""
    return result.get("instance_id") if isinstance(result, dict) else None


def _kept_bytes(content: tuple | None, answer: Answer | None) -> int:
    """Tell how much is kept of a request, as ``_Handler`` describes it, and of its answer."""
    return 0 if content is None or answer is None else len(content[1]) + len(answer.body)


def _prefers_tensors(accept: str, content_type: str) -> bool:
    # Reading the header properly takes time in each step, and few clients write more than a name.
    if TENSORS not in accept:
        return False
    if accept == TENSORS:
        return True
    return parse_accept_header(accept, MIMEAccept).best_match([TENSORS, content_type]) == TENSORS


def _view(handler: _Handler) -> Callable[..., Response]:
    """Return Flask's view of a route."""

    def view(**variables: str) -> Response:
        answer = handler.answer(
            _Request(
                request.method,
                request.path,
                variables,
                _query(request.args),
                request.get_data(cache=False),
                request.environ.get("CONTENT_TYPE", ""),
                request.environ.get("HTTP_ACCEPT", ""),
            )
        )
        return _response(answer)

    return view


def _send(answer: Answer, start_response: Callable) -> Iterable[bytes]:
    start_response(*_head(answer))
    return (answer.body,)


def _turn_away(refusal: GymServerError, environ: dict) -> Answer:
    """Answer who may not come in; people get the reason on the page that they wanted."""
    path = environ["PATH_INFO"]
    wants_page = "text/html" in environ.get("HTTP_ACCEPT", "")
    if refusal.code == "unauthorized" and wants_page and _WATCH_PAGE.fullmatch(path):
        page = wire.answer(watch_routes.page(path, refusal.status), None)
        return page._replace(headers=(*page.headers, *refusal.headers))
    return _failure(refusal, None)


def _refuse_to_stop() -> None:
    raise shutdown_disabled()


def _query(args: MultiDict) -> dict[str, str | list[str]]:
    """Return a query's fields; one that was given several times is a list, which no field takes."""
    return {name: values[0] if len(values) == 1 else values for name, values in args.lists()}


def _failure(error: BaseException, request_id: RequestId | None) -> Answer:
    status, body = answer_to(error)
    answer = wire.answer(body, request_id, status)
    if isinstance(error, GymServerError):
        answer = answer._replace(headers=error.headers)
    elif isinstance(error, MethodNotAllowed):
        answer = answer._replace(headers=(("Allow", ", ".join(sorted(error.valid_methods))),))
    return answer


def _head(answer: Answer) -> tuple[str, list[tuple[str, str]]]:
    """Return an answer's status and headers in WSGI's words."""
    headers = [
        ("Content-Type", answer.content_type),
        ("Content-Length", str(len(answer.body))),
        *answer.headers,
    ]
    return f"{answer.status} {HTTPStatus(answer.status).phrase}", headers


def _response(answer: Answer) -> Response:
    response = Response(answer.body, answer.status, content_type=answer.content_type)
    response.headers.extend(answer.headers)
    return response
