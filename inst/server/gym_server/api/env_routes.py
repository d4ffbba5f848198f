"""The routes of environments: create, reset, step, draw, record and close them; their spaces."""

from __future__ import annotations

from gym_server.api import env_fields
from gym_server.api.calls import Call
from gym_server.api.exactly_once import START
from gym_server.api.routing import INSTANCE, RouteBlueprint
from gym_server.envs.config import EnvConfig
from gym_server.instances.about import about
from gym_server.protocol.answers import tensor_response
from gym_server.protocol.bodies import parse_path_value
from gym_server.protocol.fields import ANYTHING, BOOLEAN, OBJECT, TEXT, Field
from gym_server.rendering.png import png
from gym_server.response import Response

bp = RouteBlueprint("envs")


@bp.declare(
    "POST",
    "/v1/envs/",
    Field("env_id", env_fields.ANY_ID, required=True),
    Field("seed", env_fields.SEED),
    Field("render_mode", TEXT),
    Field("kwargs", OBJECT),
    Field("wrappers", env_fields.WRAPPERS),
    Field("num_envs", env_fields.POSITIVE),
    Field("vectorization_mode", env_fields.VECTORIZATION_MODE),
    Field("num_workers", env_fields.NUM_WORKERS),
    Field("autoreset_mode", env_fields.AUTORESET_MODE),
    Field("name", env_fields.NAME),
    once=True,
)
def env_create(call: Call) -> dict:
    """Create an environment."""
    fields = {**call.fields, "wrappers": call.fields["wrappers"] or ()}
    return {**about(call.services.instances.create(EnvConfig(**fields))), "server": START}


@bp.declare("GET", "/v1/envs/")
def env_list_all(call: Call) -> dict:
    """List the environments."""
    return {"all_envs": call.services.instances.env_ids()}


@bp.declare("GET", "/v1/instances/")
def instance_list(call: Call) -> dict:
    """List the environments, with how much they are used."""
    return {"instances": call.services.instances.list()}


@bp.declare("GET", INSTANCE)
def env_about(call: Call) -> dict:
    """Describe an environment."""
    return about(call.instance)


@bp.declare(
    "POST",
    INSTANCE + "reset/",
    Field("seed", env_fields.RESET_SEED),
    Field("options", OBJECT),
    Field("reset_mask", env_fields.MASK),
    env_fields.INFO,
    once=True,
    tensors=True,
)
def env_reset(call: Call) -> dict:
    """Start an episode."""
    fields = call.fields
    return call.instance.reset(
        fields["seed"], fields["options"], call.wanted_form, fields["reset_mask"]
    )


@bp.declare(
    "POST",
    INSTANCE + "step/",
    Field("action", ANYTHING, required=True),
    Field("render", BOOLEAN),
    Field("step_mask", env_fields.MASK),
    env_fields.INFO,
    env_fields.FINAL_OBS,
    once=True,
    tensors=True,
    tensor_body=True,
)
def env_step(call: Call) -> dict:
    """Take one step."""
    fields = call.fields
    return call.instance.step(
        fields["action"], call.wanted_form, fields["step_mask"], fields["render"] or False
    )


@bp.declare(
    "GET",
    INSTANCE + "render/",
    Field("sub_env", env_fields.QUERY_INTEGER),
    content_type="image/png",
    tensors=True,
)
def env_render(call: Call) -> Response:
    """Draw the current state."""
    frame = call.instance.render(call.fields["sub_env"] or 0)
    if call.form.tensors:
        return tensor_response({"frame": frame}, {}, call.form.by_column)
    return Response(200, png(frame), "image/png")


@bp.declare("GET", INSTANCE + "model/")
def env_model(call: Call) -> dict:
    """Return the transition model of an environment that has one."""
    return call.instance.transition_model()


@bp.declare("POST", INSTANCE + "close/", once=True, ends_instance=True)
def env_close(call: Call) -> None:
    """Close an environment."""
    call.services.instances.close(call.path["instance_id"])


@bp.declare("DELETE", INSTANCE, once=True, ends_instance=True)
def env_delete(call: Call) -> None:
    """Close an environment, like the route close/."""
    env_close(call)


# Spaces --------------------------------------------------------------------------------------


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


# Monitors, which record episodes -------------------------------------------------------------


@bp.declare(
    "POST",
    INSTANCE + "monitor/start/",
    Field("directory", TEXT, required=True),
    Field("force", BOOLEAN),
    Field("resume", BOOLEAN),
    Field("video_callable", env_fields.VIDEO_CALLABLE),
)
def env_monitor_start(call: Call) -> None:
    """Record the episodes that start from now on."""
    fields = call.fields
    call.instance.start_monitor(
        call.services.monitor_root,
        fields["directory"],
        bool(fields["force"]),
        bool(fields["resume"]),
        fields["video_callable"] or 0,
    )


@bp.declare("POST", INSTANCE + "monitor/close/")
def env_monitor_close(call: Call) -> None:
    """Finish the monitor's files; without a monitor, do nothing."""
    call.instance.close_monitor()
