"""Routes as they are declared, and how a request finds its own."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

from gym_server.protocol.answers import JSON, Content, Ready
from gym_server.protocol.fields import Field

INSTANCE = "/v1/envs/<instance_id>/"

# What an instance_id is made of.
_HEX_DIGITS = frozenset("0123456789abcdef")

Handler = Callable[..., dict | Content | Ready | None]


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
        path: also matches without its last slash; ``<name>`` at the beginning of a segment stands
            for any text, which the handler gets under that name.
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
    refusal_page: Callable[[str, int], Content] | None = None

    @property
    def status(self) -> int:
        """The status of an ordinary answer."""
        return 200 if self.answer else 204

    @property
    def variables(self) -> list[str]:
        """The names of the path's variable parts."""
        return [_variable(part)[0] for part in self.path.split("/") if part.startswith("<")]


class Table(list[Route]):
    """Routes, in the order of their declaration."""

    def declare(
        self, method: str, path: str, *fields: Field, **how: Any
    ) -> Callable[[Handler], Handler]:
        """Declare a handler as a route; ``how`` are the later attributes of ``Route``."""

        def as_route(handler: Handler) -> Handler:
            self.append(Route(method, path, fields, handler, **how))
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


class _Node:
    """The beginning of some routes' paths, and what may follow it."""

    def __init__(self) -> None:
        self.routes: dict[str, Route] = {}
        self.fixed: dict[str, _Node] = {}
        # The name of a variable segment, what such a segment ends with, and its node.
        self.variable: tuple[str, str, _Node] | None = None


class Router:
    """Finds the route of each request: one look into a dictionary for each segment of its path.

    Flask's own dispatch takes longer than many a step. Of a fixed and a variable segment that both
    fit, the fixed one is meant.
    """

    def __init__(self, routes: Iterable[Route]) -> None:
        """Take the routes."""
        self._root = _Node()
        for route in routes:
            node = self._root
            for part in route.path.strip("/").split("/"):
                node = _add(node, part)
            node.routes[route.method] = route
            if route.method == "GET":
                node.routes["HEAD"] = route

    def match(self, environ: dict) -> Match | None:
        """Return the route of a request in WSGI's words; None where there is none."""
        path = environ["PATH_INFO"]
        if not path.isascii():
            path = path.encode("latin-1").decode("utf-8", "replace")
        # A client may put the path behind an address that ends with a slash.
        path = "/" + path.lstrip("/")
        variables = {}
        node = self._root
        # Like Flask's, our routes take one slash more at their end, and one less.
        for part in path.removesuffix("/").removesuffix("/").split("/")[1:]:
            next_node = node.fixed.get(part)
            if next_node is None:
                if node.variable is None or not part:
                    return None
                name, ending, next_node = node.variable
                if ending and (not part.endswith(ending) or part == ending):
                    return None
                variables[name] = part[: len(part) - len(ending)]
            node = next_node
        route = node.routes.get(environ["REQUEST_METHOD"])
        return None if route is None else Match(route, variables, path)


def _add(node: _Node, part: str) -> _Node:
    """Return the node of a segment that follows another's."""
    if not part.startswith("<"):
        return node.fixed.setdefault(part, _Node())
    name, ending = _variable(part)
    if node.variable is None:
        node.variable = name, ending, _Node()
    if node.variable[:2] != (name, ending):
        raise ValueError(f"{part} stands where <{node.variable[0]}>{node.variable[1]} does")
    return node.variable[2]


def _variable(part: str) -> tuple[str, str]:
    """Return the name of a variable segment, and what follows the variable in it."""
    name, _, ending = part[1:].partition(">")
    return name, ending
