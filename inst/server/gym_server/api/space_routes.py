"""The routes of the action and observation spaces."""

from __future__ import annotations

from gym_server.api.calls import Call
from gym_server.api.routing import INSTANCE, RouteBlueprint
from gym_server.protocol.bodies import parse_path_value
from gym_server.protocol.fields import ANYTHING, Field

bp = RouteBlueprint("spaces")


_SPACE = INSTANCE + "<any(action_space, observation_space):space>/"


@bp.declare("GET", _SPACE)
def env_space_info(call: Call) -> dict:
    """Describe a space."""
    return {"info": call.instance.space_info(call.path["space"])}


@bp.declare("GET", INSTANCE + "action_space/sample/")
def env_action_space_sample(call: Call) -> dict:
    """Sample an action."""
    return {"action": call.instance.sample_action()}


@bp.declare("GET", INSTANCE + "action_space/contains/<x>/")
def env_action_space_contains(call: Call) -> dict:
    """Check whether a value is an action."""
    value = parse_path_value(call.path["x"])
    return {"member": call.instance.contains("action_space", {"value": value})}


@bp.declare("POST", _SPACE + "contains/", Field("value", ANYTHING))
def env_space_contains(call: Call) -> dict:
    """Check whether a value is a member of a space, or a description matches the space."""
    return {"member": call.instance.contains(call.path["space"], call.body)}
