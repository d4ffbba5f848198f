"""The protocol, for machines: an OpenAPI document made from the routes' own declarations."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING

from gym_server import __version__, wire
from gym_server.tensors import TENSORS

if TYPE_CHECKING:
    from gym_server.routes import Route
    from gym_server.wire import Field

_ERROR = {
    "type": "object",
    "required": ["message", "code"],
    "properties": {
        "message": {"type": "string"},
        "code": {"type": "string"},
        "hint": {"type": "string"},
        "extra": {"type": "string", "description": "The extra of the server that is missing."},
    },
}


def document(routes: Iterable[Route]) -> dict:
    """Return the OpenAPI 3.1 document of some routes."""
    paths: dict[str, dict] = {}
    for route in routes:
        path = re.sub(r"<(\w+)>", r"{\1}", route.path)
        paths.setdefault(path, {})[route.method.lower()] = _operation(route)
    return {
        "openapi": "3.1.0",
        "info": {
            "title": "gym_server",
            "version": __version__,
            "description": "Gymnasium environments over HTTP.",
        },
        "paths": paths,
        "components": {"schemas": {"Error": _ERROR}},
    }


def _operation(route: Route) -> dict:
    doc = route.handler.__doc__ or ""
    operation = {
        "operationId": route.handler.__name__,
        "summary": doc.split("\n")[0],
        "responses": {
            str(route.status): _answer(route),
            "default": {
                "description": "What went wrong.",
                "content": {wire.JSON: {"schema": {"$ref": "#/components/schemas/Error"}}},
            },
        },
    }
    parameters = [
        {"name": name, "in": "path", "required": True, "schema": {"type": "string"}}
        for name in re.findall(r"<(\w+)>", route.path)
    ]
    if route.method == "GET":
        parameters += map(_query, route.fields)
    elif fields := (*route.fields, wire.REQUEST) if route.once else route.fields:
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
                    "description": "Key and number of the request, when it had them.",
                    "schema": {"type": "string"},
                }
            }
        return answer
    is_json = route.content_type == wire.JSON
    content: dict = {route.content_type: {"schema": {"type": "object"}} if is_json else {}}
    if route.tensors:
        # Raw bytes have no schema.
        content[TENSORS] = {}
    return {"description": route.answer, "content": content}


def _query(field: Field) -> dict:
    return {
        "name": field.name,
        "in": "query",
        "required": field.required,
        "description": field.doc,
        "schema": field.kind.schema,
    }


def _request_body(route: Route, fields: Iterable[Field]) -> dict:
    body = {
        "required": any(field.required for field in fields),
        "content": {wire.JSON: {"schema": _body(fields)}},
    }
    if route.tensor_body:
        body["content"][TENSORS] = {}
        body["description"] = (
            "As tensors: one safetensors file of the tensors 'action' (parts of nested ones by "
            "JSON pointer, 'action/camera/0'); the other fields are JSON in its metadata, and so "
            "are 'texts', an object of those by name."
        )
    return body


def _body(fields: Iterable[Field]) -> dict:
    schema = {
        "type": "object",
        "properties": {
            field.name: {**field.kind.schema, "description": field.doc} for field in fields
        },
    }
    required = [field.name for field in fields if field.required]
    if required:
        schema["required"] = required
    return schema
