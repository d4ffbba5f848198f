"""A request finds its route, and only where Flask's own map would find it."""

import itertools

import pytest
from werkzeug.exceptions import HTTPException

from gym_server.api.routes import ROUTES
from gym_server.api.routing import Route, Router, Table

ROUTER = Router(ROUTES)

# Segments of paths, sound ones and others.
PARTS = [
    "",
    "v1",
    "envs",
    "0a",
    "watch",
    "watch.css",
    "a.js",
    ".js",
    "x.css",
    "contains",
    "%",
    "\xe9",
]


def found(path, method="GET"):
    """Return the handler's name and the variables of a request's route, or None."""
    environ = {"PATH_INFO": path, "REQUEST_METHOD": method}
    match = ROUTER.match(environ)
    return match and (match.route.handler.__name__, match.variables)


def found_by_flask(app, path, method):
    environ = {"PATH_INFO": path, "REQUEST_METHOD": method, "HTTP_HOST": "localhost"}
    environ |= {"SERVER_NAME": "localhost", "SERVER_PORT": "80", "wsgi.url_scheme": "http"}
    try:
        return app.url_map.bind_to_environ(environ).match()
    except HTTPException:
        return None


@pytest.mark.parametrize("route", ROUTES, ids=lambda route: route.handler.__name__)
def test_every_route_is_found_with_and_without_its_last_slash(route):
    assert route.path.endswith("/")
    path, variables = route.path, {}
    for number, name in enumerate(route.variables):
        variables[name] = str(number)
        path = path.replace(f"<{name}>", str(number))
    for written in (path, path.removesuffix("/")):
        assert found(written, route.method) == (route.handler.__name__, variables)


@pytest.mark.parametrize("method", ["GET", "HEAD", "POST", "DELETE", "OPTIONS", "PUT"])
def test_flask_and_the_router_find_the_same(app, method):
    paths = ["/".join(parts) for n in range(1, 6) for parts in itertools.product(PARTS, repeat=n)]
    # Some hundred thousand; the beginnings that lead nowhere are left out.
    paths = [path for path in paths if path.startswith(("/v1/", "//", "v1/", "/envs"))][::7]
    paths += [f"/v1/envs/0a/{rest}" for rest in ("step", "reset//", "action_space/contains/a%2f")]
    for path in paths:
        assert found(path, method) == found_by_flask(app, path, method), path


def test_what_is_not_ascii_is_read_as_utf_8():
    path = "/v1/envs/0a/action_space/contains/\u00e9".encode().decode("latin-1")
    assert found(path) == ("env_action_space_contains", {"instance_id": "0a", "x": "\u00e9"})
    assert found("/v1/envs/\xff/") == ("env_about", {"instance_id": "\ufffd"})


def test_two_variables_in_one_place_are_refused():
    table = Table()
    table.append(Route("GET", "/<a>/", (), print))
    table.append(Route("GET", "/<b>/", (), print))
    with pytest.raises(ValueError, match="<b>"):
        Router(table)
