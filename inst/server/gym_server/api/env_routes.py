"""The routes of environments: create, reset, step, draw and close them."""

from __future__ import annotations

from gym_server.api import env_fields, schemas
from gym_server.api.calls import Call
from gym_server.api.routing import INSTANCE, RouteBlueprint
from gym_server.envs.config import EnvConfig
from gym_server.protocol.answers import Ready, tensor_response
from gym_server.protocol.fields import ANYTHING, BOOLEAN, OBJECT, TEXT, Field
from gym_server.protocol.known_headers import loads_tensors
from gym_server.rendering.png import png
from gym_server.response import Response

bp = RouteBlueprint("envs")


@bp.declare(
    "POST",
    "/v1/envs/",
    Field("env_id", env_fields.ANY_ID, "The id, such as CartPole-v1.", required=True),
    Field(
        "seed",
        env_fields.SEED,
        "Seeds the action space, and the first reset unless that has a seed; with num_envs also a "
        "list with one for each sub-environment.",
    ),
    Field(
        "render_mode",
        TEXT,
        "rgb_array (the default if supported), or human: the same, but slowed down to real time "
        "while somebody watches.",
    ),
    Field("kwargs", OBJECT, "Arguments of the environment."),
    Field("wrappers", env_fields.WRAPPERS, "Gymnasium's wrappers; the first one is innermost."),
    Field(
        "num_envs",
        env_fields.POSITIVE,
        "The number of sub-environments; absent for a single environment.",
    ),
    Field(
        "vectorization_mode",
        env_fields.VECTORIZATION_MODE,
        "What runs the sub-environments; absent for the fastest that supports the request.",
    ),
    Field(
        "num_workers",
        env_fields.NUM_WORKERS,
        "How many processes run the sub-environments; 0 for the server's own, absent to let the "
        "server choose.",
    ),
    Field(
        "autoreset_mode",
        env_fields.AUTORESET_MODE,
        "When a sub-environment whose episode ended is reset, in Gymnasium's terms; absent for "
        "NextStep.",
    ),
    Field("name", env_fields.NAME, "Its owner's name for it; shown in lists."),
    answer="instance_id, and everything about the environment",
    once=True,
    grows=True,
    schema=schemas.json_object(
        {**schemas.ABOUT_INSTANCE, "instance_id": {"type": "string", "pattern": "^[0-9a-f]{8}$"}}
    ),
)
def env_create(call: Call) -> dict:
    """Create an environment."""
    fields = {**call.fields, "wrappers": call.fields["wrappers"] or ()}
    return call.services.instances.create(EnvConfig(**fields)).about()


@bp.declare(
    "GET",
    "/v1/envs/",
    answer="all_envs: env_id by instance_id",
    schema=schemas.json_object(
        {"all_envs": {"type": "object", "additionalProperties": schemas.TEXT}}
    ),
)
def env_list_all(call: Call) -> dict:
    """List the environments."""
    return {"all_envs": call.services.instances.env_ids()}


@bp.declare(
    "GET",
    "/v1/instances/",
    answer="instances: instance_id, env_id, name, num_envs, age_seconds, idle_seconds, steps, "
    "watched of each, oldest first",
    schema=schemas.json_object(
        {"instances": {"type": "array", "items": schemas.json_object(schemas.LISTED_INSTANCE)}}
    ),
)
def instance_list(call: Call) -> dict:
    """List the environments, with how much they are used."""
    return {"instances": call.services.instances.list()}


@bp.declare(
    "GET",
    INSTANCE,
    answer="everything about the environment; needs_reset is true after done, too",
    schema=schemas.json_object(schemas.ABOUT_INSTANCE),
)
def env_about(call: Call) -> dict:
    """Describe an environment."""
    return call.instance.about()


@bp.declare(
    "POST",
    INSTANCE + "reset/",
    Field(
        "seed",
        env_fields.RESET_SEED,
        "Seeds the environment and its action space; with sub-environments also a list with one "
        "for each. One of these may be a list: the first for now, the others for the episodes that "
        "the sub-environment starts automatically. After the last one it rests: a step returns its "
        "last observation and a reward of 0.",
    ),
    Field("options", OBJECT, "Options for the environment."),
    Field(
        "reset_mask", env_fields.MASK, "Which sub-environments to reset; absent for all of them."
    ),
    env_fields.INFO,
    answer="observation, info; with sub-environments one row for each",
    once=True,
    tensors=True,
    schema=schemas.json_object(
        {"observation": schemas.ANYTHING, "info": {"type": "object"}}, request=schemas.REQUEST
    ),
)
def env_reset(call: Call) -> dict | Ready:
    """Start an episode."""
    fields = call.fields
    if isinstance(fields["seed"], tuple):
        call.services.instances.account.check()
    return call.instance.reset(
        fields["seed"], fields["options"], call.wanted_form, fields["reset_mask"]
    )


@bp.declare(
    "POST",
    INSTANCE + "step/",
    Field(
        "action",
        ANYTHING,
        "A member of the action space, except that the bounds of a Box are not checked; with "
        "sub-environments one for each that steps.",
        required=True,
    ),
    Field(
        "render",
        BOOLEAN,
        "Whether to slow the step down to real time while somebody watches.",
    ),
    Field("step_mask", env_fields.MASK, "Which sub-environments step; absent for all of them."),
    env_fields.INFO,
    env_fields.FINAL_OBS,
    answer="observation, reward, done, terminated, truncated, info; with sub-environments one row "
    "for each that stepped, and final_obs and final_sub_envs if sub-environments ended and were "
    "reset in the same step",
    once=True,
    tensors=True,
    tensor_body=loads_tensors,
    schema=schemas.json_object(
        {
            "observation": schemas.ANYTHING,
            "reward": schemas.NUMBERS,
            "done": schemas.FLAGS,
            "terminated": schemas.FLAGS,
            "truncated": schemas.FLAGS,
            "info": {"type": "object"},
        },
        request=schemas.REQUEST,
    ),
)
def env_step(call: Call) -> dict | Ready:
    """Take one step."""
    fields = call.fields
    return call.instance.step(
        fields["action"], call.wanted_form, fields["step_mask"], fields["render"] or False
    )


@bp.declare(
    "GET",
    INSTANCE + "render/",
    Field(
        "sub_env", env_fields.QUERY_INTEGER, "Which sub-environment, from 0; absent for the first."
    ),
    answer="the current frame",
    grows=True,
    content_type="image/png",
    tensors=True,
)
def env_render(call: Call) -> Response:
    """Draw the current state."""
    frame = call.instance.render(call.fields["sub_env"] or 0)
    if call.form.tensors:
        return tensor_response({"frame": frame}, {}, call.form.by_column)
    return Response(200, png(frame), "image/png")


@bp.declare(
    "GET",
    INSTANCE + "model/",
    answer="model: num_states and num_actions, both numbered from 0; start, the probability that "
    "an episode starts in each state; state, action, next_state, probability, reward and "
    "terminated, each with one element per transition with a probability above 0, sorted by state "
    "and action. Time limits are not included",
    grows=True,
    schema=schemas.json_object({"model": schemas.TRANSITION_MODEL}),
)
def env_model(call: Call) -> dict | Ready:
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
