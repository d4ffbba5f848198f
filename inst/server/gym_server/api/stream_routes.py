"""The route that makes a connection a stream of steps and resets."""

from __future__ import annotations

import uuid

from gym_server.api import env_fields
from gym_server.api.calls import Call
from gym_server.api.routing import INSTANCE, RouteBlueprint
from gym_server.api.stream import Stream
from gym_server.api.websocket import accept_key
from gym_server.errors import GymServerError
from gym_server.protocol.fields import KEY, Field
from gym_server.response import Response

bp = RouteBlueprint("stream")


@bp.declare(
    "GET",
    INSTANCE + "stream/",
    Field("key", KEY),
    Field("order", env_fields.named({"column": True})),
    Field("numbers", env_fields.named({"float64": True})),
)
def env_stream(call: Call) -> Response:
    """Open a WebSocket for steps and resets."""
    headers = call.environ
    key = headers.get("HTTP_SEC_WEBSOCKET_KEY", "")
    if (
        headers.get("HTTP_UPGRADE") != "websocket"
        or headers.get("HTTP_SEC_WEBSOCKET_VERSION") != "13"
        or not key
    ):
        raise GymServerError(
            "upgrade_required",
            "A stream is a WebSocket of version 13, and the request does not ask for one",
            "without a WebSocket, POST to step/ and reset/",
        )
    own = call.fields["key"] or uuid.uuid4().hex
    by_column, as_float64 = (bool(call.fields[name]) for name in ("order", "numbers"))
    stream = Stream(call, own, by_column, as_float64)
    accepted = (
        ("Upgrade", "websocket"),
        ("Connection", "Upgrade"),
        ("Sec-WebSocket-Accept", accept_key(key)),
    )
    return Response(101, b"", "", accepted, stream.serve)
