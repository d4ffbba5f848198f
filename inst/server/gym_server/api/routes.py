"""The protocol's routes: each takes a parsed request, calls one method, and answers."""

from __future__ import annotations

import os
import platform
from dataclasses import replace

import gymnasium
import numpy

from gym_server import __version__
from gym_server.api import fields, model_routes, openapi, rollout_routes, schemas, watch_routes
from gym_server.api.calls import Call
from gym_server.api.routing import INSTANCE, Table
from gym_server.envs.config import EnvConfig
from gym_server.envs.registry import LONGEST_ID
from gym_server.errors import GymServerError
from gym_server.protocol.answers import HTML, Content, Ready, frame_tensor
from gym_server.protocol.bodies import loads_tensors, parse_path_value
from gym_server.protocol.fields import ANYTHING, BOOLEAN, OBJECT, TEXT, Field
from gym_server.rendering.png import png

ROUTES = Table()


@ROUTES.declare(
    "POST",
    "/v1/envs/",
    Field("env_id", fields.ANY_ID, "What to create, such as CartPole-v1.", required=True),
    Field(
        "seed",
        fields.SEED,
        "Seeds the action space, and the first reset unless that has a seed; with num_envs also a "
        "list of one for each sub-environment.",
    ),
    Field(
        "render_mode",
        TEXT,
        "rgb_array (the default where it is supported), or human: the same, but while somebody "
        "watches it moves in real time.",
    ),
    Field("kwargs", OBJECT, "Handed to the environment."),
    Field("wrappers", fields.WRAPPERS, "Gymnasium's, by name; the first one is innermost."),
    Field(
        "num_envs", fields.POSITIVE, "How many sub-environments; absent for a single environment."
    ),
    Field(
        "vectorization_mode",
        fields.VECTORIZATION_MODE,
        "What runs the sub-environments; absent for the fastest that can do what is asked.",
    ),
    Field(
        "num_workers",
        fields.NUM_WORKERS,
        "How many processes run the sub-environments; 0 for the server's own, absent to let the "
        "server choose.",
    ),
    Field(
        "autoreset_mode",
        fields.AUTORESET_MODE,
        "What becomes of a sub-environment whose episode ended, in Gymnasium's words; absent for "
        "NextStep.",
    ),
    Field("name", fields.NAME, "What its owner calls it; shown wherever it is listed."),
    answer="instance_id",
    once=True,
    grows=True,
    schema=schemas.json_object({"instance_id": {"type": "string", "pattern": "^[0-9a-f]{8}$"}}),
)
def env_create(call: Call) -> dict:
    """Create an environment."""
    fields = {**call.fields, "wrappers": call.fields["wrappers"] or ()}
    return {"instance_id": call.services.instances.create(EnvConfig(**fields))}


@ROUTES.declare(
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


@ROUTES.declare(
    "GET",
    "/v1/instances/",
    answer="instances: instance_id, env_id, name, num_envs, age_seconds, idle_seconds, steps, "
    "watched of each, the oldest first",
    schema=schemas.json_object(
        {"instances": {"type": "array", "items": schemas.json_object(schemas.LISTED_INSTANCE)}}
    ),
)
def instance_list(call: Call) -> dict:
    """List the environments, with who uses them how much."""
    return {"instances": call.services.instances.list()}


@ROUTES.declare(
    "GET",
    INSTANCE,
    answer="all about the environment; needs_reset also after done",
    schema=schemas.json_object(schemas.ABOUT_INSTANCE),
)
def env_about(call: Call) -> dict:
    """Tell all about an environment."""
    return call.instance.about()


@ROUTES.declare(
    "POST",
    INSTANCE + "reset/",
    Field(
        "seed",
        fields.RESET_SEED,
        "Seeds the environment and its action space; with sub-environments also a list of one for "
        "each. One of these may be a list: the first for now, the others for the episodes that the "
        "sub-environment begins by itself. After the last one it rests: in a step it returns its "
        "last observation and the reward 0.",
    ),
    Field("options", OBJECT, "The environment's own."),
    Field("reset_mask", fields.MASK, "Which sub-environments are reset; absent for all of them."),
    fields.INFO,
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


@ROUTES.declare(
    "POST",
    INSTANCE + "step/",
    Field(
        "action",
        ANYTHING,
        "A member of the action space, a Box's bounds aside; with sub-environments one for each "
        "that steps.",
        required=True,
    ),
    Field(
        "render",
        BOOLEAN,
        "Whether people want to see it: while somebody watches, the step waits until real time "
        "has come so far.",
    ),
    Field("step_mask", fields.MASK, "Which sub-environments step; absent for all of them."),
    fields.INFO,
    fields.FINAL_OBS,
    answer="observation, reward, done, terminated, truncated, info; with sub-environments one row "
    "for each that stepped, and final_obs and final_sub_envs where sub-environments ended and were "
    "reset at once",
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


@ROUTES.declare(
    "GET",
    INSTANCE + "action_space/",
    answer="info: the space",
    schema=schemas.SPACE_INFO,
)
def env_action_space_info(call: Call) -> dict:
    """Describe the action space."""
    return {"info": call.instance.space_info("action_space")}


@ROUTES.declare(
    "GET",
    INSTANCE + "observation_space/",
    answer="info: the space",
    schema=schemas.SPACE_INFO,
)
def env_observation_space_info(call: Call) -> dict:
    """Describe the observation space."""
    return {"info": call.instance.space_info("observation_space")}


@ROUTES.declare(
    "GET",
    INSTANCE + "action_space/sample/",
    answer="action",
    schema=schemas.json_object({"action": schemas.ANYTHING}),
)
def env_action_space_sample(call: Call) -> dict:
    """Draw an action."""
    return {"action": call.instance.sample_action()}


@ROUTES.declare(
    "GET",
    INSTANCE + "action_space/contains/<x>/",
    answer="member: true or false",
    schema=schemas.MEMBER,
)
def env_action_space_contains(call: Call) -> dict:
    """Tell whether a value is an action."""
    value = parse_path_value(call.path["x"])
    return {"member": call.instance.contains("action_space", {"value": value})}


_VALUE = Field("value", ANYTHING, "Is it a member? Without it: is the description right?")


@ROUTES.declare(
    "POST",
    INSTANCE + "action_space/contains/",
    _VALUE,
    answer="member: true or false",
    schema=schemas.MEMBER,
)
def env_action_space_contains_posted(call: Call) -> dict:
    """Tell whether a value is an action, or a description the action space's."""
    return {"member": call.instance.contains("action_space", call.body)}


@ROUTES.declare(
    "POST",
    INSTANCE + "observation_space/contains/",
    _VALUE,
    answer="member: true or false",
    schema=schemas.MEMBER,
)
def env_observation_space_contains(call: Call) -> dict:
    """Tell whether a value is an observation, or a description the observation space's."""
    return {"member": call.instance.contains("observation_space", call.body)}


@ROUTES.declare(
    "GET",
    INSTANCE + "render/",
    Field("sub_env", fields.QUERY_INTEGER, "Which sub-environment, from 0; absent for the first."),
    answer="the current frame",
    grows=True,
    content_type="image/png",
    tensors=True,
)
def env_render(call: Call) -> Content:
    """Draw the current state."""
    frame = call.instance.render(call.fields["sub_env"] or 0)
    if call.form.tensors:
        return frame_tensor(frame, call.form)
    return Content(png(frame), "image/png")


@ROUTES.declare(
    "POST",
    INSTANCE + "monitor/start/",
    Field("directory", TEXT, "Where to write, relative to --monitor-dir.", required=True),
    Field("force", BOOLEAN, "Delete what monitors left there that are gone."),
    Field("resume", BOOLEAN, "Go on counting where an earlier monitor ended."),
    Field("video_callable", fields.VIDEO_CALLABLE, "Record a video of every (n-th) episode."),
    grows=True,
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


@ROUTES.declare("POST", INSTANCE + "monitor/close/")
def env_monitor_close(call: Call) -> None:
    """Finish the monitor's files; without a monitor there is nothing to do."""
    call.instance.close_monitor()


@ROUTES.declare("POST", INSTANCE + "close/", once=True, ends_instance=True)
def env_close(call: Call) -> None:
    """Close an environment."""
    call.services.instances.close(call.path["instance_id"])


@ROUTES.declare("DELETE", INSTANCE, once=True, ends_instance=True)
def env_delete(call: Call) -> None:
    """Close an environment, as its route close/ does."""
    env_close(call)


@ROUTES.declare(
    "POST",
    "/v1/upload/",
    Field("training_dir", TEXT, "A monitor's directory.", required=True),
    Field("api_key", TEXT, "A key to OpenAI Gym.", required=True),
    Field("algorithm_id", ANYTHING, "Ignored."),
    answer="nothing: 410 always",
)
def upload(call: Call) -> None:
    """Refuse an upload: the service that took them closed in 2017."""
    raise GymServerError(
        "upload_closed",
        "Nothing was uploaded: OpenAI closed its scoreboard in 2017",
        "the monitor's directory holds your results",
    )


@ROUTES.declare(
    "POST",
    "/v1/shutdown/",
    answer="message",
    html=True,
    schema=schemas.json_object({"message": schemas.TEXT}),
)
def shutdown(call: Call) -> dict | Content:
    """Answer the requests under way and stop the server."""
    call.services.stop()
    message = "Server shutting down"
    if HTML in call.accept:
        # As the classic server answered.
        return Content(message.encode(), f"{HTML}; charset=utf-8")
    return {"message": message}


_SEARCH = replace(TEXT, schema={"type": "string", "maxLength": LONGEST_ID})


@ROUTES.declare(
    "GET",
    "/v1/registry/",
    Field("search", _SEARCH, "A part of the id; when it is part of none, the nearest ids."),
    answer="environments: id, max_episode_steps, reward_threshold, vectorised, extra, available, "
    "reason (why one is not available)",
    schema=schemas.json_object(
        {"environments": {"type": "array", "items": schemas.LISTED_ENVIRONMENT}}
    ),
)
def env_registry(call: Call) -> dict:
    """List what can be created."""
    return {"environments": call.services.instances.registered(call.fields["search"])}


@ROUTES.declare(
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
    """Tell that the server is well, and its versions."""
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


@ROUTES.declare("GET", "/v1/openapi.json/", answer="this document")
def openapi_document(call: Call) -> dict:
    """Describe the protocol for machines."""
    return openapi.document(call.services.routes)


ROUTES.extend([*model_routes.ROUTES, *rollout_routes.ROUTES, *watch_routes.ROUTES])
