"""The routes of the server itself: what it can create, its health, its shutdown."""

from __future__ import annotations

import os
import platform
from dataclasses import replace

import gymnasium
import numpy

from gym_server import __version__
from gym_server.api import openapi, schemas
from gym_server.api.calls import Call
from gym_server.api.routing import RouteBlueprint
from gym_server.envs.registry import LONGEST_ID
from gym_server.errors import GymServerError
from gym_server.protocol.answers import HTML
from gym_server.protocol.fields import ANYTHING, TEXT, Field
from gym_server.response import Response

bp = RouteBlueprint("server")


@bp.declare(
    "POST",
    "/v1/upload/",
    Field("training_dir", TEXT, "A monitor's directory.", required=True),
    Field("api_key", TEXT, "A key to OpenAI Gym.", required=True),
    Field("algorithm_id", ANYTHING, "Ignored."),
    answer="nothing: 410 always",
)
def upload(call: Call) -> None:
    """Refuse an upload: the service for it closed in 2017."""
    raise GymServerError(
        "upload_closed",
        "Nothing was uploaded: OpenAI closed its scoreboard in 2017",
        "the monitor's directory holds your results",
    )


@bp.declare(
    "POST",
    "/v1/shutdown/",
    answer="message",
    html=True,
    schema=schemas.json_object({"message": schemas.TEXT}),
)
def shutdown(call: Call) -> dict | Response:
    """Answer the requests in progress, and stop the server."""
    call.services.stop()
    message = "Server shutting down"
    if HTML in call.accept:
        # As on the classic server.
        return Response(200, message.encode(), f"{HTML}; charset=utf-8")
    return {"message": message}


_SEARCH = replace(TEXT, schema={"type": "string", "maxLength": LONGEST_ID})


@bp.declare(
    "GET",
    "/v1/registry/",
    Field("search", _SEARCH, "A part of the id; if no id contains it, the most similar ids."),
    answer="environments: id, max_episode_steps, reward_threshold, vectorised, extra, available, "
    "reason (why one is not available)",
    schema=schemas.json_object(
        {"environments": {"type": "array", "items": schemas.LISTED_ENVIRONMENT}}
    ),
)
def env_registry(call: Call) -> dict:
    """List the environments that can be created."""
    return {"environments": call.services.instances.registered(call.fields["search"])}


@bp.declare(
    "GET",
    "/v1/health/",
    answer="status, instances, versions, pid, rollouts (true: it plays whole episodes)",
    schema=schemas.json_object(
        {
            "status": {"const": "ok"},
            "instances": schemas.COUNT,
            "versions": {"type": "object", "additionalProperties": schemas.TEXT},
            "pid": schemas.COUNT,
            "rollouts": {"const": True},
        }
    ),
)
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
        "rollouts": True,
    }


@bp.declare("GET", "/v1/openapi.json/", answer="this document")
def openapi_document(call: Call) -> dict:
    """Describe the protocol for machines."""
    return openapi.document(call.services.routes)
