"""The protocol, for machines: an OpenAPI document made from the routes' own declarations."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING

from gym_server import __version__, wire

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
            str(route.status): {"description": route.answer},
            "default": {
                "description": "What went wrong.",
                "content": {"application/json": {"schema": {"$ref": "#/components/schemas/Error"}}},
            },
        },
    }
    names = re.findall(r"<(\w+)>", route.path)
    if names:
        operation["parameters"] = [
            {"name": name, "in": "path", "required": True, "schema": {"type": "string"}}
            for name in names
        ]
    fields = (*route.fields, wire.REQUEST) if route.once else route.fields
    if fields:
        operation["requestBody"] = {
            "required": any(field.required for field in fields),
            "content": {"application/json": {"schema": _body(fields)}},
        }
    return operation


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
