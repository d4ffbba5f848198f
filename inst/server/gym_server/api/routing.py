"""Routes as they are declared: each is a rule of Flask's, and what this server adds to it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

from flask import Blueprint, Flask
from werkzeug.exceptions import HTTPException

from gym_server.protocol.answers import Ready
from gym_server.protocol.fields import Field
from gym_server.response import JSON, Response

INSTANCE = "/v1/envs/<instance_id>/"

# What an instance_id is made of.
_HEX_DIGITS = frozenset("0123456789abcdef")

Handler = Callable[..., dict | Response | Ready | None]

# How many of the last requests' routes are remembered, and of how long paths.
_MOST_KNOWN = 4096
_LONGEST_KNOWN = 100

_VARIABLE = re.compile("<([a-z_]+)>")


class Callers(Enum):
    """Who may call a route of a server that has a token."""

    TOKEN = "who shows the token"
    WATCHERS = "who shows the token, or a key to the watch page of the instance in the path"
    EVERYONE = "everyone"


@dataclass(frozen=True, eq=False)
class Route:
    """One route of the protocol.

    Attributes:
        method: "GET", which also answers HEAD, "POST" or "DELETE".
        path: also matches without its last slash; ``<name>`` stands for any text, which the handler
            gets under that name.
        fields: what the body may hold, or the query of a GET.
        handler: is given a ``Call``; returns a JSON object, a content of its own, or None for 204.
        answer: what the answer holds, in words.
        schema: the JSON schema of an answer in JSON; None for any object.
        callers: who may call it.
        once: whether the body may also hold an idempotency key, by which the request is done once
            however often it arrives.
        grows: whether it makes the server or its processes hold more memory.
        ends_instance: whether the instance in the path is gone afterwards.
        content_type: what an ordinary answer is.
        tensors: whether the answer may also be tensors, when the client accepts them.
        html: whether the answer may also be HTML, when the client asks for that.
        tensor_body: reads the body where that is tensors; None where it may not be.
        refusal_page: makes the page, of a path and a status, that people get in place of an error
            in JSON when they may not call the route; None where there is no such page.
    """

    method: str
    path: str
    fields: tuple[Field, ...]
    handler: Handler
    answer: str = ""
    schema: dict[str, Any] | None = None
    callers: Callers = Callers.TOKEN
    once: bool = False
    grows: bool = False
    ends_instance: bool = False
    content_type: str = JSON
    tensors: bool = False
    html: bool = False
    tensor_body: Callable[[bytes], dict] | None = None
    refusal_page: Callable[[str, int], Response] | None = None

    @property
    def status(self) -> int:
        """The status of an ordinary answer."""
        return 200 if self.answer else 204

    @property
    def variables(self) -> list[str]:
        """The names of the path's variable parts."""
        return _VARIABLE.findall(self.path)


class Room(Blueprint):
    """The routes of one noun.

    Attributes:
        routes: in the order of their declaration, by the name that Flask knows each by.
    """

    def __init__(self, name: str) -> None:
        """Start with none."""
        super().__init__(name, __name__)
        self.routes: dict[str, Route] = {}

    def declare(
        self, method: str, path: str, *fields: Field, **how: Any
    ) -> Callable[[Handler], Handler]:
        """Declare a handler as a route; ``how`` are the later attributes of ``Route``."""

        def as_route(handler: Handler) -> Handler:
            name = handler.__name__
            self.routes[f"{self.name}.{name}"] = Route(method, path, fields, handler, **how)
            self.add_url_rule(
                path, name, methods=[method], provide_automatic_options=False, strict_slashes=False
            )
            return handler

        return as_route


class Match(NamedTuple):
    """The route that a request asks for.

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
        """Who may make this request; what has no instance's id where one belongs needs a token."""
        has_id = _HEX_DIGITS.issuperset(self.variables.get("instance_id", ""))
        return self.route.callers if has_id else Callers.TOKEN


class Router:
    """Finds the route of each request in Flask's map, and remembers it: that takes 10 us."""

    def __init__(self, app: Flask, rooms: Iterable[Room]) -> None:
        """Register the rooms with the application."""
        self._routes: dict[str, Route] = {}
        for room in rooms:
            app.register_blueprint(room)
            self._routes |= room.routes
        self._urls = app.url_map.bind("")
        # By the method and the path of a request.
        self._known: dict[tuple[str, str], Match] = {}

    def match(self, environ: dict) -> Match | None:
        """Return the route of a request in WSGI's words; None where there is none."""
        key = environ["REQUEST_METHOD"], environ["PATH_INFO"]
        match = self._known.get(key)
        if match is None:
            match = self._find(*key)
            if match is not None and len(match.path) <= _LONGEST_KNOWN:
                if len(self._known) >= _MOST_KNOWN:
                    self._known.clear()
                self._known[key] = match
        return match

    def _find(self, method: str, path: str) -> Match | None:
        if not path.isascii():
            path = path.encode("latin-1").decode("utf-8", "replace")
        # A client may put the path behind an address that ends with a slash.
        path = "/" + path.lstrip("/")
        try:
            name, variables = self._urls.match(path, method)
        except HTTPException:
            return None
        return Match(self._routes[name], dict(variables), path)
