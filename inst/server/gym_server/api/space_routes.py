"""The routes of the action and observation spaces."""

from __future__ import annotations

from gym_server.api import schemas
from gym_server.api.calls import Call
from gym_server.api.routing import INSTANCE, RouteBlueprint
from gym_server.protocol.bodies import parse_path_value
from gym_server.protocol.fields import ANYTHING, Field

bp = RouteBlueprint("spaces")


@bp.declare(
    "GET",
    INSTANCE + "action_space/",
    answer="info: the space",
    schema=schemas.SPACE_INFO,
)
def env_action_space_info(call: Call) -> dict:
    """Describe the action space."""
    return {"info": call.instance.space_info("action_space")}


@bp.declare(
    "GET",
    INSTANCE + "observation_space/",
    answer="info: the space",
    schema=schemas.SPACE_INFO,
)
def env_observation_space_info(call: Call) -> dict:
    """Describe the observation space."""
    return {"info": call.instance.space_info("observation_space")}


@bp.declare(
    "GET",
    INSTANCE + "action_space/sample/",
    answer="action",
    schema=schemas.json_object({"action": schemas.ANYTHING}),
)
def env_action_space_sample(call: Call) -> dict:
    """Sample an action."""
    return {"action": call.instance.sample_action()}


@bp.declare(
    "GET",
    INSTANCE + "action_space/contains/<x>/",
    answer="member: true or false",
    schema=schemas.MEMBER,
)
def env_action_space_contains(call: Call) -> dict:
    """Check whether a value is an action."""
    value = parse_path_value(call.path["x"])
    return {"member": call.instance.contains("action_space", {"value": value})}


_VALUE = Field("value", ANYTHING, "The value to check; without it, the body is a description.")


@bp.declare(
    "POST",
    INSTANCE + "action_space/contains/",
    _VALUE,
    answer="member: true or false",
    schema=schemas.MEMBER,
)
def env_action_space_contains_posted(call: Call) -> dict:
    """Check whether a value is an action, or a description matches the action space."""
    return {"member": call.instance.contains("action_space", call.body)}


@bp.declare(
    "POST",
    INSTANCE + "observation_space/contains/",
    _VALUE,
    answer="member: true or false",
    schema=schemas.MEMBER,
)
def env_observation_space_contains(call: Call) -> dict:
    """Check whether a value is an observation, or a description matches the observation space."""
    return {"member": call.instance.contains("observation_space", call.body)}
