"""The Flask application."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path

from flask import Flask, Response, request
from werkzeug.exceptions import MethodNotAllowed

from gym_server import wire
from gym_server.errors import answer_to
from gym_server.exactly_once import ExactlyOnce, RequestId
from gym_server.frames import RenderThread
from gym_server.instances import Instances
from gym_server.monitor_directory import MonitorRoot
from gym_server.routes import ROUTES, Call, Route, Services
from gym_server.tensors import TENSORS
from gym_server.wire import Answer


@dataclass(frozen=True)
class Config:
    """How a server is set up.

    Attributes:
        monitor_dir: monitors write below it; None for a fresh temporary directory.
        temporary_monitors: whether they may also write below the system's temporary directory.
        allowed_modules: names of the modules that an env_id may import.
        max_body_bytes: the size of the largest request.
        stop: asks the server to stop once the requests under way are answered.
    """

    monitor_dir: Path | None = None
    temporary_monitors: bool = True
    allowed_modules: Collection[str] = ()
    max_body_bytes: int = 16 * 2**20
    stop: Callable[[], None] = lambda: None


class GymApp(Flask):
    """The application, with what it has to put in order at the end."""

    def __init__(self, config: Config) -> None:
        """Set up the services and the routes."""
        super().__init__("gym_server", static_folder=None)
        self.config["MAX_CONTENT_LENGTH"] = config.max_body_bytes
        self._renderer = RenderThread()
        self._monitor_root = MonitorRoot(config.monitor_dir, config.temporary_monitors)
        self._instances = Instances(config.allowed_modules, self._renderer)
        services = Services(
            self._instances,
            self._monitor_root,
            config.stop,
        )
        exactly_once: ExactlyOnce[Answer] = ExactlyOnce()
        for route in ROUTES:
            self.add_url_rule(
                route.path,
                endpoint=route.handler.__name__,
                view_func=_view(route, services, exactly_once),
                methods=[route.method],
                provide_automatic_options=False,
                strict_slashes=False,
            )
        self.register_error_handler(Exception, lambda error: _response(_failure(error, None)))

    def close(self) -> None:
        """Close every environment and monitor."""
        self._instances.close_all()
        self._renderer.stop()
        self._monitor_root.close()


def create_app(config: Config | None = None) -> GymApp:
    """Return the application; call its ``close()`` at the end."""
    return GymApp(config or Config())


def _view(
    route: Route, services: Services, exactly_once: ExactlyOnce[Answer]
) -> Callable[..., Response]:
    def view(**path: str) -> Response:
        sends_tensors = route.tensor_body and TENSORS in request.environ.get("CONTENT_TYPE", "")
        if route.method == "GET":
            raw, body = b"", request.args.to_dict()
        else:
            raw = request.get_data(cache=False)
            body = wire.loads_tensors(raw) if sends_tensors else wire.loads(raw)
        wants_tensors = route.tensors and _accepts_tensors(route)
        request_id = wire.read(body, (wire.REQUEST,))["request"] if route.once else None

        def perform() -> Answer:
            try:
                call = Call(services, path, body, wire.read(body, route.fields), wants_tensors)
                return wire.answer(route.handler(call), request_id)
            except Exception as error:
                return _failure(error, request_id)

        if request_id is None:
            return _response(perform())
        digest = blake2b(raw, digest_size=16).digest()
        content = (request.method, request.path, digest, sends_tensors, wants_tensors)
        try:
            answer = exactly_once.answer(request_id, content, perform)
        except Exception as error:
            answer = _failure(error, request_id)
        return _response(answer)

    return view


def _accepts_tensors(route: Route) -> bool:
    # Reading the header properly takes time in each step, and few clients name tensors in it.
    if TENSORS not in request.environ.get("HTTP_ACCEPT", ""):
        return False
    return request.accept_mimetypes.best_match([TENSORS, route.content_type]) == TENSORS


def _failure(error: Exception, request_id: RequestId | None) -> Answer:
    status, body = answer_to(error)
    answer = wire.answer(body, request_id, status)
    if isinstance(error, MethodNotAllowed):
        answer = answer._replace(headers=(("Allow", ", ".join(sorted(error.valid_methods))),))
    return answer


def _response(answer: Answer) -> Response:
    response = Response(answer.body, answer.status, content_type=answer.content_type)
    response.headers.extend(answer.headers)
    return response
