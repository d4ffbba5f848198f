"""The protocol described for machines: an OpenAPI document, made from the routes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from gym_server import __version__
from gym_server.api.routing import Route
from gym_server.protocol.answers import HTML
from gym_server.protocol.bodies import loads_file
from gym_server.protocol.fields import REQUEST, Field
from gym_server.protocol.known_headers import loads_tensors
from gym_server.protocol.safetensors import COLUMN_TENSORS, TENSORS
from gym_server.response import JSON

_ERROR = {
    "type": "object",
    "required": ["message", "code", "documentation_url"],
    "properties": {
        "message": {"type": "string"},
        "code": {"type": "string"},
        "documentation_url": {"type": "string", "format": "uri"},
        "hint": {"type": "string"},
        "extra": {"type": "string", "description": "The extra of the server that is missing."},
    },
}


# Classic clients send one of these for a parameter that is not set.
_ABSENT: dict[str, Any] = {"enum": [None, "", []], "description": "As if it were not there."}
_ABSENT_REFERENCE = {"$ref": "#/components/schemas/Absent"}


def document(routes: Iterable[Route]) -> dict:
    """Return the OpenAPI 3.1 document of some routes."""
    routes = list(routes)
    paths: dict[str, dict] = {}
    for route in routes:
        paths.setdefault(route.template, {})[route.method.lower()] = _operation(route)
    _link_created(paths)
    return {
        "openapi": "3.1.0",
        "info": {
            "title": "gym_server",
            "version": __version__,
            "description": "Gymnasium environments over HTTP.",
        },
        "paths": paths,
        "components": {"schemas": {"Error": _ERROR, "Absent": _ABSENT}},
    }


def _link_created(paths: dict[str, dict]) -> None:
    """Link the instance_id in the response of a creation to the operations that use one."""
    created = paths.get("/v1/envs/", {}).get("post")
    if created is None:
        return
    created["responses"]["200"]["links"] = {
        operation["operationId"]: {
            "operationId": operation["operationId"],
            "parameters": {"instance_id": "$response.body#/instance_id"},
        }
        for path, operations in paths.items()
        for operation in operations.values()
        if "{instance_id}" in path
    }


def _operation(route: Route) -> dict:
    doc = route.handler.__doc__ or ""
    operation: dict[str, Any] = {
        "operationId": route.handler.__name__,
        "summary": doc.split("\n")[0],
        "responses": {
            str(route.status): _answer(route),
            "default": {
                "description": "What went wrong.",
                "content": {JSON: {"schema": {"$ref": "#/components/schemas/Error"}}},
            },
        },
    }
    parameters = [
        {
            "name": name,
            "in": "path",
            "required": True,
            "schema": {"enum": values} if values else {"type": "string"},
        }
        for name, values in route.variables.items()
    ]
    if route.method == "GET":
        parameters += map(_query, route.fields)
    elif fields := (*route.fields, REQUEST) if route.once else route.fields:
        operation["requestBody"] = _request_body(route, fields)
    if parameters:
        operation["parameters"] = parameters
    return operation


def _answer(route: Route) -> dict:
    if not route.answer:
        answer: dict = {"description": "Done."}
        if route.once:
            answer["headers"] = {
                "Gym-Request": {
                    "description": "The request's idempotency key: its key, a space, its number.",
                    "schema": {"type": "string"},
                }
            }
        return answer
    is_json = route.content_type == JSON
    schema = route.schema or {"type": "object"}
    content: dict = {route.content_type: {"schema": schema} if is_json else {}}
    if route.html:
        content[HTML] = {}
    if route.tensors:
        # Raw bytes have no schema.
        content[TENSORS] = content[COLUMN_TENSORS] = {}
        return {"description": f"{route.answer}. {_LAYOUTS}", "content": content}
    return {"description": route.answer, "content": content}


_LAYOUTS = (
    "As tensors: a safetensors file, with the other values as JSON in its metadata. By column "
    "(order=column), tensors with two or more dimensions are transposed and their shape reversed: "
    "the bytes are in the order of R and Fortran."
)


def _query(field: Field) -> dict:
    schema = field.kind.schema
    if field.kind.empty_is_absent and schema.get("type") != "string":
        schema = {"anyOf": [schema, {"const": "", "description": _ABSENT["description"]}]}
    return {
        "name": field.name,
        "in": "query",
        "required": field.required,
        "description": field.doc,
        "schema": schema,
    }


def _request_body(route: Route, fields: Iterable[Field]) -> dict:
    required = any(field.required for field in fields)
    schema = _body(fields)
    body: dict[str, Any] = {
        "required": required,
        "content": {
            JSON: {"schema": schema if required else {"anyOf": [schema, _ABSENT_REFERENCE]}}
        },
    }
    if route.tensor_body:
        body["content"][TENSORS] = {}
        body["description"] = _TENSOR_BODIES[route.tensor_body]
    return body


_TENSOR_BODIES: dict[Callable, str] = {
    loads_tensors: "As tensors: a safetensors file with the tensors 'action' (parts of nested ones "
    "by JSON pointer, 'action/camera/0'); the other fields are JSON in its metadata, and so is "
    "'texts', an object of texts by name.",
    loads_file: "As tensors: a safetensors file. The tensor 'seed' (integers) has the seed of each "
    "episode, 'candidate' (integers from 0) the candidate that plays it. If an environment is "
    "played in groups, 'row' is the episode's place in its group (the description's 'group'). "
    "'policy/weights' is float64 with a row for each candidate, 'policy/mean' and 'policy/scale' "
    "normalize observations (the policy's 'clip_obs' clips them then), 'policy/q' is a table of "
    "states by actions, 'policy/deviation' has standard deviations. The other fields are JSON in "
    "its metadata.",
}


def _body(fields: Iterable[Field]) -> dict:
    schema = {
        "type": "object",
        "properties": {field.name: _property(field) for field in fields},
    }
    required = [field.name for field in fields if field.required]
    if required:
        schema["required"] = required
    return schema


def _property(field: Field) -> dict:
    """Return the schema of everything a field accepts, including values that mean it is absent."""
    schema = field.kind.schema
    if field.required:
        if field.kind.empty_is_absent and schema.get("type") == "string":
            schema = {**schema, "minLength": 1}
        if not schema:
            schema = {"not": {"type": "null"}}
    elif schema:
        absent = _ABSENT_REFERENCE if field.kind.empty_is_absent else {"type": "null"}
        schema = {"anyOf": [schema, absent]}
    return {**schema, "description": field.doc}
