"""Find the route of a request."""

import re

import pytest

from gym_server.api.app import BLUEPRINTS

ROUTES = [route for bp in BLUEPRINTS for route in bp.routes.values()]


@pytest.fixture
def found(app):
    """Return the handler's name and the variables of a request's route, ."""

    def found(path, method="GET"):
        match = app._router.match({"PATH_INFO": path, "REQUEST_METHOD": method})
        return match.route.handler.__name__, match.variables

    return found


@pytest.mark.parametrize("route", ROUTES, ids=lambda route: route.handler.__name__)
def test_every_route_is_found_with_and_without_its_last_slash(found, route):
    assert route.path.endswith("/")
    path, variables = route.path, {}
    parts = re.findall(r"<(?:any[(](.*?)[)]:)?(.*?)>", path)
    for number, (values, name) in enumerate(parts):
        variables[name] = values.split(", ")[-1] or str(number)
        path = re.sub("<.*?>", variables[name], path, count=1)
    for written in (path, path.removesuffix("/")):
        assert found(written, route.method) == (route.handler.__name__, variables)


def test_what_is_not_ascii_is_read_as_utf_8(found):
    path = "/v1/envs/0a/action_space/contains/\u00e9".encode().decode("latin-1")
    assert found(path) == ("env_action_space_contains", {"instance_id": "0a", "x": "\u00e9"})
    assert found("/v1/envs/\xff/") == ("env_about", {"instance_id": "\ufffd"})


def test_a_path_may_have_several_slashes_for_one(found):
    assert found("//v1/envs/") == found("/v1//envs/") == found("/v1/envs/")
