"""The Flask application: creates the services, checks requests, and passes them to their routes.

Flask maps URLs to routes, and provides the test client. Its own dispatch takes longer than many
steps, so requests bypass it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field
from pathlib import Path

import flask
from flask import Flask

from gym_server.api import env_routes, rollout_routes, server_routes, stream_routes, watch_routes
from gym_server.api.access import Access, Guard
from gym_server.api.calls import Services
from gym_server.api.endpoint import Endpoint
from gym_server.api.exactly_once import ExactlyOnce
from gym_server.api.open_streams import OpenStreams
from gym_server.api.routing import Callers, Match, Router
from gym_server.api.watch_keys import WatchKeys
from gym_server.errors import GymServerError, body_too_large, malformed_request
from gym_server.manager.instance_manager import InstanceManager
from gym_server.manager.limits import Limits
from gym_server.manager.rollouts import Rollouts
from gym_server.manager.watchdog import Watchdog
from gym_server.monitoring.monitor_directory import MonitorRoot
from gym_server.protocol.answers import failure
from gym_server.rendering.render_thread import RenderThread
from gym_server.response import Admission, Response

BLUEPRINTS = (
    env_routes.bp,
    rollout_routes.bp,
    server_routes.bp,
    stream_routes.bp,
    watch_routes.bp,
)


@dataclass(frozen=True)
class Config:
    """The configuration of a server.

    Attributes:
        monitor_dir: where monitors write; None for a new temporary directory.
        allowed_modules: the modules that an env_id may import.
        max_body_bytes: the size of the largest request.
        limits: the limits.
        stop: asks the server to stop after answering the requests in progress.
        access: which requests the server accepts.
        is_private: whether its clients may name files as arguments of environments, and have
            monitors write below the system's temporary directory.
        watch_prefix: what the keys of watch pages begin with.
        ends_unused: whether to stop when nobody has used the server for ``limits.idle_minutes``.
    """

    monitor_dir: Path | None = None
    allowed_modules: Collection[str] = ()
    max_body_bytes: int = 16 * 2**20
    limits: Limits = field(default_factory=Limits)
    stop: Callable[[], None] = lambda: None
    access: Access = field(default_factory=Access)
    is_private: bool = True
    watch_prefix: str = ""
    ends_unused: bool = False


class GymApp(Flask):
    """The application, which must be closed at the end."""

    def __init__(self, config: Config) -> None:
        """Create the services and the routes."""
        super().__init__("gym_server", static_folder=None)
        self._renderer = RenderThread()
        self._monitor_root = MonitorRoot(config.monitor_dir, config.is_private)
        self._instances = InstanceManager(
            config.allowed_modules,
            self._renderer,
            config.limits,
            config.is_private,
        )
        watch_keys = WatchKeys(prefix=config.watch_prefix)
        self._guard = Guard(config.access, watch_keys)
        self._rollouts = Rollouts(config.limits.rollout_processes)
        self._exactly_once = ExactlyOnce(self._instances.lives)
        self._router = Router(self, BLUEPRINTS)
        self._max_body_bytes = config.max_body_bytes
        self._services = Services(
            self._instances,
            self._rollouts,
            self._monitor_root,
            config.stop,
            OpenStreams(self._exactly_once, config.max_body_bytes),
            watch_keys if config.access.token is not None else None,
        )
        self._watchdog = Watchdog(
            self._instances,
            self._rollouts,
            config.limits,
            config.stop if config.ends_unused else lambda: None,
        )

    def admit(self, environ: dict) -> Admission | Response:
        """Say how to answer a request before its body is read, or refuse it.

        Args:
            environ: the request's head, as a WSGI environ.
        """
        found = self._router.match(environ)
        match = found if isinstance(found, Match) else None
        try:
            self._guard.check(environ, match)
        except GymServerError as refusal:
            return _refused(refusal, environ, match)
        if isinstance(found, Response):
            return Admission(lambda *_: found)
        endpoint = Endpoint(environ, found, self._services, self._exactly_once)
        has_token = self._guard.has_token(environ)
        is_known = has_token or found.callers is Callers.WATCHERS
        return Admission(endpoint.respond, is_known, lasts=has_token)

    def wsgi_app(self, environ: dict, start_response: Callable) -> Iterable[bytes]:
        """Answer a request by WSGI, for Flask's test client."""
        length = int(environ.get("CONTENT_LENGTH") or 0)
        answer = self.admit({"CONTENT_TYPE": "", **environ})
        if length > self._max_body_bytes:
            answer = self.refuse(413, "")
        if isinstance(answer, Admission):
            answer = answer.respond(environ["wsgi.input"].read(length), lambda: True)
        made = flask.Response(answer.body, answer.status, content_type=answer.content_type)
        made.headers.extend(answer.headers)
        return made(environ, start_response)

    def refuse(self, status: int, reason: str) -> Response:
        """Return the response to a request that does not reach the application.

        Args:
            status: 400 or 413.
            reason: what is wrong with the request, for 400.
        """
        return failure(body_too_large() if status == 413 else malformed_request(reason))

    def begin_stop(self) -> None:
        """Answer clients that would otherwise wait for longer than the stop may take."""
        self._instances.end_watching()
        self._rollouts.end()

    def close(self) -> None:
        """Close every environment and monitor."""
        self._watchdog.stop()
        self._rollouts.end()
        self._instances.close_all()
        self._renderer.stop()
        self._monitor_root.close()


def create_app(config: Config | None = None) -> GymApp:
    """Create the application; call its ``close()`` at the end."""
    return GymApp(config or Config())


def _refused(refusal: GymServerError, environ: dict, match: Match | None) -> Response:
    """Refuse a request; people get a page with the reason, if they asked for a page."""
    if (
        match is not None
        and match.route.refusal_page is not None
        and match.callers is not Callers.TOKEN
        and refusal.code == "unauthorized"
        and "text/html" in environ.get("HTTP_ACCEPT", "")
    ):
        page = match.route.refusal_page(match.path, refusal.status)
        return page._replace(headers=(*page.headers, *refusal.headers))
    return failure(refusal)
