import json

import pytest

from gym_server.openapi import document
from gym_server.routes import ROUTES


def test_the_document_names_every_route(client):
    answer = client.get("/v1/openapi.json")
    assert answer.status_code == 200
    assert answer.json["openapi"].startswith("3.1")
    operations = [
        (method.upper(), path.replace("{", "<").replace("}", ">"))
        for path, methods in answer.json["paths"].items()
        for method in methods
    ]
    assert sorted(operations) == sorted((route.method, route.path) for route in ROUTES)


def test_the_document_is_made_of_the_fields_that_are_parsed():
    body = document(ROUTES)["paths"]["/v1/envs/{instance_id}/step/"]["post"]["requestBody"]
    schema = body["content"]["application/json"]["schema"]
    assert schema["required"] == ["action"]
    assert set(schema["properties"]) == {"action", "render", "request"}
    json.dumps(schema, allow_nan=False)


@pytest.mark.parametrize("route", ROUTES, ids=lambda route: route.handler.__name__)
def test_every_route_is_described(route):
    assert route.handler.__doc__
    assert all(field.doc for field in route.fields)


def test_operation_ids_are_unique():
    names = [route.handler.__name__ for route in ROUTES]
    assert len(names) == len(set(names))
