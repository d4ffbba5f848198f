import json

import jsonschema
import openapi_spec_validator
import pytest

from gym_server.api.openapi import document
from gym_server.api.routes import ROUTES
from gym_server.response import JSON


def test_the_document_names_every_route(client):
    answer = client.get("/v1/openapi.json")
    assert answer.status_code == 200
    assert answer.json["openapi"].startswith("3.1")
    operations = [
        (method.upper(), path)
        for path, methods in answer.json["paths"].items()
        for method in methods
    ]
    assert sorted(operations) == sorted((route.method, route.template) for route in ROUTES)


def test_the_document_is_made_of_the_fields_that_are_parsed():
    body = document(ROUTES)["paths"]["/v1/envs/{instance_id}/step/"]["post"]["requestBody"]
    schema = body["content"]["application/json"]["schema"]
    assert schema["required"] == ["action"]
    assert set(schema["properties"]) == {
        "action",
        "final_obs",
        "info",
        "render",
        "request",
        "step_mask",
    }
    json.dumps(schema, allow_nan=False)


@pytest.mark.parametrize("route", ROUTES, ids=lambda route: route.handler.__name__)
def test_every_route_is_described(route):
    assert route.handler.__doc__
    assert all(field.doc for field in route.fields)


@pytest.mark.parametrize("route", ROUTES, ids=lambda route: route.handler.__name__)
def test_every_answer_in_json_has_a_schema(route):
    has_none = route.content_type != JSON or not route.answer
    always_refused, the_document = "upload", "openapi_document"
    name = route.handler.__name__
    assert has_none or route.schema or name in (always_refused, the_document)


def test_operation_ids_are_unique():
    names = [route.handler.__name__ for route in ROUTES]
    assert len(names) == len(set(names))


def test_the_document_is_valid(client):
    openapi_spec_validator.validate(client.get("/v1/openapi.json").json)


def test_tensors_stand_where_they_are_taken_and_given():
    paths = document(ROUTES)["paths"]
    tensors = "application/x-safetensors"
    given = {
        operation["operationId"]
        for methods in paths.values()
        for operation in methods.values()
        if tensors in operation["responses"].get("200", {}).get("content", {})
    }
    taken = {
        operation["operationId"]
        for methods in paths.values()
        for operation in methods.values()
        if tensors in operation.get("requestBody", {}).get("content", {})
    }
    assert given == {"env_reset", "env_step", "env_render", "rollouts"}
    assert taken == {"env_step", "rollouts"}


def test_the_query_of_a_get_is_no_body():
    operation = document(ROUTES)["paths"]["/v1/registry/"]["get"]
    assert "requestBody" not in operation
    assert [(p["name"], p["in"]) for p in operation["parameters"]] == [("search", "query")]


@pytest.mark.parametrize("route", ROUTES, ids=lambda route: route.handler.__name__)
def test_every_kind_of_answer_is_named(route):
    operation = document([route])["paths"].popitem()[1][route.method.lower()]
    content = operation["responses"][str(route.status)].get("content", {})
    assert (route.content_type in content) is (route.status == 200)
    assert operation["responses"]["default"]["content"]["application/json"]


def test_sub_envs_are_described():
    paths = document(ROUTES)["paths"]

    def fields(path):
        body = paths[path]["post"]["requestBody"]["content"]["application/json"]
        schema = body["schema"]
        return schema.get("properties") or schema["anyOf"][0]["properties"]

    def meant(field):
        schema, absent = field["anyOf"]
        assert absent == {"$ref": "#/components/schemas/Absent"}
        return schema

    created = fields("/v1/envs/")
    assert meant(created["num_envs"])["minimum"] == 1
    assert meant(created["vectorization_mode"])["enum"] == ["vector_entry_point", "sync", "async"]
    assert meant(created["autoreset_mode"])["enum"] == ["NextStep", "SameStep", "Disabled"]
    assert "reset_mask" in fields("/v1/envs/{instance_id}/reset/")
    drawn = paths["/v1/envs/{instance_id}/render/"]["get"]["parameters"]
    assert [parameter["name"] for parameter in drawn] == ["instance_id", "sub_env"]


def test_the_environment_ids_that_it_names_can_be_created(client):
    """So that a fuzzer that knows no other ids finds instances."""
    body = document(ROUTES)["paths"]["/v1/envs/"]["post"]["requestBody"]
    examples = body["content"]["application/json"]["schema"]["properties"]["env_id"]["examples"]
    assert len(examples) > 1
    for env_id in examples:
        assert client.post("/v1/envs/", json={"env_id": env_id}).status_code == 200


def test_the_longest_search_is_named(client):
    (search,) = document(ROUTES)["paths"]["/v1/registry/"]["get"]["parameters"]
    longest = search["schema"]["maxLength"]
    for length, status in ((longest, 200), (longest + 1, 400)):
        assert client.get(f"/v1/registry/?search={'x' * length}").status_code == status


def test_errors_are_as_they_are_described(client, create):
    schema = document(ROUTES)["components"]["schemas"]["Error"]
    for answer in (
        client.get("/nowhere"),
        client.post("/v1/envs/", json={"env_id": "cartpole-v1"}),
        client.post(f"{create()}/step/", json={"action": 0}),
    ):
        assert set(schema["required"]) <= set(answer.json) <= set(schema["properties"])


@pytest.mark.parametrize("flag", [True, False, 0, 1, "true", "FALSE"])
def test_flags_are_described_as_they_are_taken(client, create, flag):
    body = document(ROUTES)["paths"]["/v1/envs/{instance_id}/step/"]["post"]["requestBody"]
    render = body["content"]["application/json"]["schema"]["properties"]["render"]
    assert jsonschema.Draft202012Validator(render["anyOf"][0]).is_valid(flag)
    url = create()
    client.post(f"{url}/reset/")
    assert client.post(f"{url}/step/", json={"action": 0, "render": flag}).status_code == 200


@pytest.mark.parametrize("seed", [True, False, 0, 7, [1, None, True]])
def test_seeds_are_described_as_they_are_taken(seed):
    body = document(ROUTES)["paths"]["/v1/envs/"]["post"]["requestBody"]
    described = body["content"]["application/json"]["schema"]["properties"]["seed"]["anyOf"][0]
    assert jsonschema.Draft202012Validator(described).is_valid(seed)
