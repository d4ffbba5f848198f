"""Routes as they are declared: a Flask rule with this server's additions."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

from flask import Blueprint, Flask
from werkzeug.exceptions import HTTPException

from gym_server.protocol.answers import failure
from gym_server.protocol.fields import Field
from gym_server.response import JSON, Response

INSTANCE = "/v1/envs/<instance_id>/"

# The characters of an instance_id.
_HEX_DIGITS = frozenset("0123456789abcdef")
Handler = Callable[..., dict | Response | None]


class Callers(Enum):
    """Who may call a route on a server with a token."""

    TOKEN = "requests with the token"
    WATCHERS = "requests with the token, or with a key to the instance's watch page"
    EVERYONE = "everyone"


@dataclass(frozen=True, eq=False)
class Route:
    """One route of the protocol.

    Attributes:
        method: "GET", which also answers HEAD, "POST" or "DELETE".
        path: also matches without its last slash; ``<name>`` matches any text, and
            ``<any(a, b):name>`` one of some, which the handler gets under that name.
        fields: the fields of the body, or of a GET's query.
        handler: gets a ``Call``; returns a JSON object, another response, or None for 204.
        callers: who may call it.
        once: whether the body may have an idempotency key, with which the request is done only
            once.
        ends_instance: whether it closes the instance in the path.
        content_type: the content type of an ordinary response.
        tensors: whether the response may be tensors, if the client accepts them.
        tensor_body: whether the body may be tensors.
        raw_body: whether the handler reads the body, and the fields are those of the query.
        refusal_page: makes a page, from a path and a status, that people who may not call the route
            get instead of an error in JSON; None for no page.
    """

    method: str
    path: str
    fields: tuple[Field, ...]
    handler: Handler
    callers: Callers = Callers.TOKEN
    once: bool = False
    ends_instance: bool = False
    content_type: str = JSON
    tensors: bool = False
    tensor_body: bool = False
    raw_body: bool = False
    refusal_page: Callable[[str, int], Response] | None = None


class RouteBlueprint(Blueprint):
    """The routes of one noun.

    Attributes:
        routes: in the order of declaration, by Flask's endpoint name.
    """

    def __init__(self, name: str) -> None:
        """Start without routes."""
        super().__init__(name, __name__)
        self.routes: dict[str, Route] = {}

    def declare(
        self, method: str, path: str, *fields: Field, **how: Any
    ) -> Callable[[Handler], Handler]:
        """Declare a handler as a route; ``how`` are the other attributes of ``Route``."""

        def as_route(handler: Handler) -> Handler:
            name = handler.__name__
            self.routes[f"{self.name}.{name}"] = Route(method, path, fields, handler, **how)
            self.add_url_rule(
                path, name, methods=[method], provide_automatic_options=False, strict_slashes=False
            )
            return handler

        return as_route


class Match(NamedTuple):
    """The route of a request.

    Attributes:
        route: the route.
        variables: the variable parts of the path, by name.
        path: the whole path, decoded.
    """

    route: Route
    variables: dict[str, str]
    path: str

    @property
    def callers(self) -> Callers:
        """Who may make this request; the token is required if the instance_id is invalid."""
        has_id = _HEX_DIGITS.issuperset(self.variables.get("instance_id", ""))
        return self.route.callers if has_id else Callers.TOKEN


class Router:
    """Finds the route of each request in Flask's map."""

    def __init__(self, app: Flask, blueprints: Iterable[RouteBlueprint]) -> None:
        """Register the blueprints with the application."""
        self._routes: dict[str, Route] = {}
        for blueprint in blueprints:
            app.register_blueprint(blueprint)
            self._routes |= blueprint.routes
        self._urls = app.url_map.bind("")

    def match(self, environ: dict) -> Match | Response:
        """Return the route of a request, given as a WSGI environ; an error if there is none."""
        path = environ["PATH_INFO"]
        if not path.isascii():
            path = path.encode("latin-1").decode("utf-8", "replace")
        # A client may append the path to an address that ends with a slash.
        path = re.sub("/+", "/", path)
        try:
            name, variables = self._urls.match(path, environ["REQUEST_METHOD"])
        except HTTPException as error:
            return failure(error)
        return Match(self._routes[name], dict(variables), path)
