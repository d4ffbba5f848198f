"""The protocol's routes: each takes a parsed request, calls one method, and answers."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy

from gym_server import __version__
from gym_server.api import fields, openapi
from gym_server.api.watch_keys import WatchKeys
from gym_server.envs.config import EnvConfig
from gym_server.envs.registry import LONGEST_ID
from gym_server.errors import GymServerError
from gym_server.instances.instance import Instance
from gym_server.manager.instance_manager import Instances
from gym_server.manager.limits import Watchers
from gym_server.monitoring.monitor_directory import MonitorRoot
from gym_server.protocol import wire
from gym_server.protocol.safetensors import TENSORS, Tensor
from gym_server.protocol.safetensors import write as write_tensors
from gym_server.protocol.wire import Content, Field
from gym_server.rendering.png import png


@dataclass(frozen=True)
class Services:
    """What the routes work on.

    Attributes:
        instances: the environments.
        monitor_root: where monitors may write.
        stop: asks the server to stop once the requests under way are answered.
        watchers: those who wait for a picture.
        watch_keys: the keys that open watch pages; None where no page asks for one.
    """

    instances: Instances
    monitor_root: MonitorRoot
    stop: Callable[[], None]
    watchers: Watchers
    watch_keys: WatchKeys | None = None


@dataclass(frozen=True)
class Call:
    """A request, parsed.

    Attributes:
        services: what to work on.
        path: the variable parts of the URL.
        body: the request's JSON object, or the query of a GET.
        fields: the values of the fields that the route declares; None for absent ones.
        tensors: whether the client wants tensors where the route has them.
        url: the path as it was asked for.
        accept: what the client says it takes.
    """

    services: Services
    path: dict[str, str]
    body: dict
    fields: dict
    tensors: bool = False
    url: str = ""
    accept: str = ""

    @property
    def instance(self) -> Instance:
        """The instance that the URL names."""
        return self.services.instances.get(self.path["instance_id"])


Handler = Callable[[Call], dict | Content | None]


@dataclass(frozen=True)
class Route:
    """One route of the protocol.

    Attributes:
        method: "GET", "POST" or "DELETE".
        path: Flask's rule, which also matches without its last slash.
        fields: what the body may hold, or the query of a GET.
        handler: returns a JSON object, a content of its own, or None for 204.
        answer: what the answer holds, in words.
        once: whether the body may also number the request, which is then done once however
            often it arrives.
        content_type: what an ordinary answer is.
        tensors: whether the answer may also be tensors, when the client accepts them.
        html: whether the answer may also be HTML, when the client asks for that.
        tensor_body: whether the body may also be tensors.
    """

    method: str
    path: str
    fields: tuple[Field, ...]
    handler: Handler
    answer: str = ""
    once: bool = False
    content_type: str = wire.JSON
    tensors: bool = False
    html: bool = False
    tensor_body: bool = False

    @property
    def status(self) -> int:
        """The status of an ordinary answer."""
        return 200 if self.answer else 204


ROUTES: list[Route] = []

INSTANCE = "/v1/envs/<instance_id>/"


def declare(method: str, path: str, *fields: Field, **how: Any) -> Callable[[Handler], Handler]:
    """Declare a handler as a route; ``how`` are the later attributes of Route."""

    def as_route(handler: Handler) -> Handler:
        ROUTES.append(Route(method, path, fields, handler, **how))
        return handler

    return as_route


@declare(
    "POST",
    "/v1/envs/",
    Field("env_id", wire.ANY_ID, "What to create, such as CartPole-v1.", required=True),
    Field(
        "seed",
        fields.SEED,
        "Seeds the action space, and the first reset without a seed; with num_envs also a list "
        "of one a sub-environment.",
    ),
    Field(
        "render_mode",
        wire.TEXT,
        "rgb_array (the default where it is supported), or human: the same, but while somebody "
        "watches it moves in real time.",
    ),
    Field("kwargs", wire.OBJECT, "Handed to the environment."),
    Field("wrappers", wire.WRAPPERS, "Gymnasium's, by name; the first one is innermost."),
    Field(
        "num_envs", fields.NUM_ENVS, "How many sub-environments; absent for a single environment."
    ),
    Field(
        "vectorization_mode",
        fields.VECTORIZATION_MODE,
        "What runs the sub-environments; absent for the fastest that can do what is asked.",
    ),
    Field(
        "autoreset_mode",
        fields.AUTORESET_MODE,
        "What becomes of a sub-environment whose episode ended, in Gymnasium's words; absent for "
        "NextStep.",
    ),
    Field("name", wire.NAME, "What its owner calls it; shown wherever it is listed."),
    answer="instance_id",
    once=True,
)
def env_create(call: Call) -> dict:
    """Create an environment."""
    fields = {**call.fields, "wrappers": call.fields["wrappers"] or ()}
    choices = EnvConfig(**fields)
    return {"instance_id": call.services.instances.create(choices)}


@declare("GET", "/v1/envs/", answer="all_envs: env_id by instance_id")
def env_list_all(call: Call) -> dict:
    """List the environments."""
    return {"all_envs": call.services.instances.env_ids()}


@declare(
    "GET",
    "/v1/instances/",
    answer="instances: instance_id, env_id, name, num_envs, age_seconds, idle_seconds, steps, "
    "watched of each, the oldest first",
)
def instance_list(call: Call) -> dict:
    """List the environments, with who uses them how much."""
    return {"instances": call.services.instances.list()}


@declare("GET", INSTANCE, answer="all about the environment; needs_reset also after done")
def env_about(call: Call) -> dict:
    """Tell all about an environment."""
    return call.instance.about()


@declare(
    "POST",
    INSTANCE + "reset/",
    Field(
        "seed",
        fields.SEED,
        "Seeds the environment and its action space; with sub-environments also a list of one for "
        "each.",
    ),
    Field("options", wire.OBJECT, "The environment's own."),
    Field("reset_mask", fields.MASK, "Which sub-environments are reset; absent for all of them."),
    answer="observation, info; with sub-environments one row a sub-environment",
    once=True,
    tensors=True,
)
def env_reset(call: Call) -> dict:
    """Start an episode."""
    fields = call.fields
    return call.instance.reset(
        fields["seed"], fields["options"], call.tensors, fields["reset_mask"]
    )


@declare(
    "POST",
    INSTANCE + "step/",
    Field(
        "action",
        wire.ANYTHING,
        "A member of the action space, a Box's bounds aside; with sub-environments one for each "
        "that steps.",
        required=True,
    ),
    Field(
        "render",
        wire.BOOLEAN,
        "Whether people want to see it: while somebody watches, the step waits until real time "
        "has come so far.",
    ),
    Field("step_mask", fields.MASK, "Which sub-environments step; absent for all of them."),
    answer="observation, reward, done, terminated, truncated, info; with sub-environments one row "
    "for each that stepped, and final_obs and final_sub_envs where sub-environments ended and were "
    "reset at once",
    once=True,
    tensors=True,
    tensor_body=True,
)
def env_step(call: Call) -> dict:
    """Take one step."""
    fields = call.fields
    return call.instance.step(
        fields["action"], call.tensors, fields["step_mask"], fields["render"] or False
    )


@declare("GET", INSTANCE + "action_space/", answer="info: the space")
def env_action_space_info(call: Call) -> dict:
    """Describe the action space."""
    return {"info": call.instance.action_space_info}


@declare("GET", INSTANCE + "observation_space/", answer="info: the space")
def env_observation_space_info(call: Call) -> dict:
    """Describe the observation space."""
    return {"info": call.instance.observation_space_info}


@declare("GET", INSTANCE + "action_space/sample/", answer="action")
def env_action_space_sample(call: Call) -> dict:
    """Draw an action."""
    return {"action": call.instance.sample_action()}


@declare("GET", INSTANCE + "action_space/contains/<x>/", answer="member: true or false")
def env_action_space_contains(call: Call) -> dict:
    """Tell whether a value is an action."""
    value = wire.parse_path_value(call.path["x"])
    return {"member": call.instance.action_contains({"value": value})}


_VALUE = Field("value", wire.ANYTHING, "Is it a member? Without it: is the description right?")


@declare("POST", INSTANCE + "action_space/contains/", _VALUE, answer="member: true or false")
def env_action_space_contains_posted(call: Call) -> dict:
    """Tell whether a value is an action, or a description the action space's."""
    return {"member": call.instance.action_contains(call.body)}


@declare("POST", INSTANCE + "observation_space/contains/", _VALUE, answer="member: true or false")
def env_observation_space_contains(call: Call) -> dict:
    """Tell whether a value is an observation, or a description the observation space's."""
    return {"member": call.instance.observation_contains(call.body)}


@declare(
    "GET",
    INSTANCE + "render/",
    Field("sub_env", fields.SUB_ENV, "Which sub-environment, from 0; absent for the first."),
    answer="the current frame",
    content_type="image/png",
    tensors=True,
)
def env_render(call: Call) -> Content:
    """Draw the current state."""
    frame = call.instance.render(call.fields["sub_env"] or 0)
    if call.tensors:
        return Content(write_tensors({"frame": Tensor.of(frame)}, {}), TENSORS)
    return Content(png(frame), "image/png")


@declare(
    "POST",
    INSTANCE + "monitor/start/",
    Field("directory", wire.TEXT, "Where to write, relative to --monitor-dir.", required=True),
    Field("force", wire.BOOLEAN, "Delete what monitors left there that are gone."),
    Field("resume", wire.BOOLEAN, "Go on counting where an earlier monitor ended."),
    Field("video_callable", wire.VIDEO_CALLABLE, "Record a video of every (n-th) episode."),
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


@declare("POST", INSTANCE + "monitor/close/")
def env_monitor_close(call: Call) -> None:
    """Finish the monitor's files; without a monitor there is nothing to do."""
    call.instance.close_monitor()


@declare("POST", INSTANCE + "close/", once=True)
def env_close(call: Call) -> None:
    """Close an environment."""
    call.services.instances.close(call.path["instance_id"])


@declare("DELETE", INSTANCE, once=True)
def env_delete(call: Call) -> None:
    """Close an environment, as its route close/ does."""
    env_close(call)


@declare(
    "POST",
    "/v1/upload/",
    Field("training_dir", wire.TEXT, "A monitor's directory.", required=True),
    Field("api_key", wire.TEXT, "A key to OpenAI Gym.", required=True),
    Field("algorithm_id", wire.ANYTHING, "Ignored."),
    answer="nothing: 410 always",
)
def upload(call: Call) -> None:
    """Refuse an upload: the service that took them closed in 2017."""
    raise GymServerError(
        "upload_closed",
        "Nothing was uploaded: OpenAI closed its scoreboard in 2017",
        "the monitor's directory holds your results",
    )


@declare("POST", "/v1/shutdown/", answer="message", html=True)
def shutdown(call: Call) -> dict | Content:
    """Answer the requests under way and stop the server."""
    call.services.stop()
    message = "Server shutting down"
    if wire.HTML in call.accept:
        # As the classic server answered.
        return Content(message.encode(), f"{wire.HTML}; charset=utf-8")
    return {"message": message}


_SEARCH = replace(wire.TEXT, schema={"type": "string", "maxLength": LONGEST_ID})


@declare(
    "GET",
    "/v1/registry/",
    Field("search", _SEARCH, "A part of the id; when it is part of none, the nearest ids."),
    answer="environments: id, max_episode_steps, reward_threshold, vectorised, extra, available, "
    "reason (why one is not available)",
)
def env_registry(call: Call) -> dict:
    """List what can be created."""
    return {"environments": call.services.instances.registered(call.fields["search"])}


@declare("GET", "/v1/health/", answer="status, instances, versions, pid")
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
    }


@declare("GET", "/v1/openapi.json/", answer="this document")
def openapi_document(call: Call) -> dict:
    """Describe the protocol for machines."""
    return openapi.document(ROUTES)
