"""The routes of the server itself: what it can create, its health, its shutdown."""

from __future__ import annotations

import os
import platform

import gymnasium
import numpy

from gym_server import __version__
from gym_server.api.calls import Call
from gym_server.api.exactly_once import START
from gym_server.api.routing import RouteBlueprint
from gym_server.errors import GymServerError
from gym_server.protocol.answers import HTML
from gym_server.protocol.fields import ANYTHING, TEXT, Field
from gym_server.response import Response

bp = RouteBlueprint("server")


@bp.declare(
    "POST",
    "/v1/upload/",
    Field("training_dir", TEXT, required=True),
    Field("api_key", TEXT, required=True),
    Field("algorithm_id", ANYTHING),
)
def upload(call: Call) -> None:
    """Refuse an upload: the service for it closed in 2017."""
    raise GymServerError(
        "upload_closed",
        "Nothing was uploaded: OpenAI closed its scoreboard in 2017",
        "the monitor's directory holds your results",
    )


@bp.declare("POST", "/v1/shutdown/")
def shutdown(call: Call) -> dict | Response:
    """Answer the requests in progress, and stop the server."""
    call.services.stop()
    message = "Server shutting down"
    if call.wants_html:
        # As on the classic server.
        return Response(200, message.encode(), f"{HTML}; charset=utf-8")
    return {"message": message}


@bp.declare("GET", "/v1/registry/", Field("search", TEXT))
def env_registry(call: Call) -> dict:
    """List the environments that can be created."""
    return {"environments": call.services.instances.registered(call.fields["search"])}


@bp.declare("GET", "/v1/health/")
def health(call: Call) -> dict:
    """Report that the server is well, and its versions."""
    return {
        "status": "ok",
        "instances": len(call.services.instances.env_ids()),
        "versions": {
            "gym_server": __version__,
            "gymnasium": gymnasium.__version__,
            "numpy": numpy.__version__,
            "python": platform.python_version(),
        },
        "pid": os.getpid(),
        "server": START,
    }
