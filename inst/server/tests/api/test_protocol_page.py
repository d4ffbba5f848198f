"""PROTOCOL.md is written by hand; here it is held against the routes."""

import re
from pathlib import Path

import pytest

from gym_server.api.app import BLUEPRINTS

ROUTES = [route for bp in BLUEPRINTS for route in bp.routes.values()]

PAGE = (Path(__file__).parents[2] / "PROTOCOL.md").read_text(encoding="utf-8")
# A row of a table by its request, `GET /v1/health/`, with what is said of the request.
ROWS = {
    request: (remark, cells)
    for request, remark, cells in re.findall(r"(?m)^\| `([A-Z]+ /[^`]+)`([^|]*)\|(.*)$", PAGE)
}


def written(route):
    return f"{route.method} {re.sub(r'<any[(].*?[)]:', '<', route.path)}"


def test_the_page_has_every_route_and_no_other():
    assert sorted(ROWS) == sorted(map(written, ROUTES))


@pytest.mark.parametrize("route", ROUTES, ids=written)
def test_the_page_has_the_fields_of_a_route(route):
    remark, cells = ROWS[written(route)]
    fields = cells.split(" | ")[0]
    for field in route.fields:
        assert f"`{field.name}`" in fields
        if field.required and route.handler.__name__ != "upload":
            assert f"`{field.name}`, required" in fields
    assert ("once" in remark) is route.once
    assert ("tensors" in remark) is route.tensors


def test_errors_are_as_the_page_says(client, create):
    for answer in (
        client.get("/nowhere"),
        client.post("/v1/envs/", json={"env_id": "cartpole-v1"}),
        client.post(f"{create()}/step/", json={"action": 0}),
    ):
        required = {"message", "code", "documentation_url"}
        assert required <= set(answer.json) <= required | {"hint", "extra"}


def test_the_longest_search_is_taken(client):
    for length, status in ((200, 200), (201, 400)):
        assert client.get(f"/v1/registry/?search={'x' * length}").status_code == status
