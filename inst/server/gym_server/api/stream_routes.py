"""The routes of a stream's messages: one makes a connection a stream, one answers a message."""

from __future__ import annotations

import uuid

from gym_server.api import env_fields
from gym_server.api.calls import Call
from gym_server.api.routing import INSTANCE, RouteBlueprint
from gym_server.api.stream import Stream
from gym_server.api.stream_layout import malformed_message
from gym_server.api.websocket import ProtocolError, accept_key
from gym_server.errors import GymServerError
from gym_server.protocol.fields import KEY, Field
from gym_server.response import Response

bp = RouteBlueprint("stream")


_FIELDS = (
    Field("key", KEY),
    Field("order", env_fields.named({"column": True})),
    Field("numbers", env_fields.named({"float64": True})),
)


@bp.declare("GET", INSTANCE + "stream/", *_FIELDS)
def env_stream(call: Call) -> Response:
    """Open a WebSocket for steps and resets; without one, return the layout of messages."""
    headers = call.environ
    if "HTTP_UPGRADE" not in headers:
        return _stream(call).layout()
    key = headers.get("HTTP_SEC_WEBSOCKET_KEY", "")
    if (
        headers["HTTP_UPGRADE"] != "websocket"
        or headers.get("HTTP_SEC_WEBSOCKET_VERSION") != "13"
        or not key
    ):
        raise GymServerError(
            "upgrade_required",
            "A stream is a WebSocket of version 13, and the request does not ask for one",
            "without a WebSocket, POST the messages",
        )
    accepted = (
        ("Upgrade", "websocket"),
        ("Connection", "Upgrade"),
        ("Sec-WebSocket-Accept", accept_key(key)),
    )
    return Response(101, b"", "", accepted, _stream(call).serve)


@bp.declare("POST", INSTANCE + "stream/", *_FIELDS, raw_body=True)
def env_message(call: Call) -> Response:
    """Answer one message of a stream."""
    try:
        return _stream(call).respond(call.raw)[0]
    except ProtocolError as error:
        raise malformed_message(str(error)) from None


def _stream(call: Call) -> Stream:
    key = call.fields["key"] or uuid.uuid4().hex
    by_column, as_float64 = (bool(call.fields[name]) for name in ("order", "numbers"))
    return Stream(call, key, by_column, as_float64)
