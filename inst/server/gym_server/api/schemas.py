"""What the routes answer, as JSON schemas; for the OpenAPI document and for whoever tests by it."""

from __future__ import annotations

_TEXT = {"type": "string"}
_FLAG = {"type": "boolean"}
_COUNT = {"type": "integer", "minimum": 0}
_SECONDS = {"type": "number", "minimum": 0}
_ANYTHING: dict = {}
_SPACE = {"type": "object", "required": ["name"], "properties": {"name": _TEXT}}
# One value, or with sub-environments one for each; what is not finite is a word.
_NUMBER = {"anyOf": [{"type": "number"}, {"enum": ["NaN", "Infinity", "-Infinity"]}]}
_NUMBERS = {"anyOf": [*_NUMBER["anyOf"], {"type": "array", "items": _NUMBER}]}
_FLAGS = {"anyOf": [_FLAG, {"type": "array", "items": _FLAG}]}


def _or_null(schema: dict) -> dict:
    return {"anyOf": [schema, {"type": "null"}]}


def _object(required: dict[str, dict], **others: dict) -> dict:
    return {
        "type": "object",
        "required": list(required),
        "properties": {**required, **others},
    }


_REQUEST = _object({"key": _TEXT, "number": _COUNT})

_LINE = {
    "instance_id": _TEXT,
    "env_id": _TEXT,
    "name": _or_null(_TEXT),
    "num_envs": _or_null(_COUNT),
    "age_seconds": _SECONDS,
    "idle_seconds": _SECONDS,
    "steps": _COUNT,
    "watched": _FLAG,
}

_ABOUT = {
    **_LINE,
    "observation_space": _SPACE,
    "action_space": _SPACE,
    "reward_threshold": _or_null(_NUMBER),
    "max_episode_steps": _or_null(_COUNT),
    "render_fps": _ANYTHING,
    "vectorization_mode": _or_null(_TEXT),
    "autoreset_mode": _or_null(_TEXT),
    "render_mode": _or_null(_TEXT),
    "kwargs": {"type": "object"},
    "wrappers": {"type": "array", "items": {"type": "object"}},
    "seed": _ANYTHING,
    "episode_steps": _or_null(_COUNT),
    "needs_reset": _FLAG,
    "monitor": _or_null({"type": "object"}),
    "isolated": _FLAG,
}

_LISTED = _object(
    {
        "id": _TEXT,
        "max_episode_steps": _or_null(_COUNT),
        "reward_threshold": _or_null(_NUMBER),
        "vectorised": _FLAG,
        "extra": _or_null(_TEXT),
        "available": _FLAG,
        "reason": _or_null(_TEXT),
    }
)

# By the route's operationId.
ANSWERS = {
    "env_create": _object({"instance_id": {"type": "string", "pattern": "^[0-9a-f]{8}$"}}),
    "env_list_all": _object({"all_envs": {"type": "object", "additionalProperties": _TEXT}}),
    "instance_list": _object({"instances": {"type": "array", "items": _object(_LINE)}}),
    "env_about": _object(_ABOUT),
    "env_reset": _object({"observation": _ANYTHING, "info": {"type": "object"}}, request=_REQUEST),
    "env_step": _object(
        {
            "observation": _ANYTHING,
            "reward": _NUMBERS,
            "done": _FLAGS,
            "terminated": _FLAGS,
            "truncated": _FLAGS,
            "info": {"type": "object"},
        },
        request=_REQUEST,
    ),
    "env_action_space_info": _object({"info": _SPACE}),
    "env_observation_space_info": _object({"info": _SPACE}),
    "env_action_space_sample": _object({"action": _ANYTHING}),
    "env_action_space_contains": _object({"member": _FLAG}),
    "env_action_space_contains_posted": _object({"member": _FLAG}),
    "env_observation_space_contains": _object({"member": _FLAG}),
    "shutdown": _object({"message": _TEXT}),
    "env_registry": _object({"environments": {"type": "array", "items": _LISTED}}),
    "health": _object(
        {
            "status": {"const": "ok"},
            "instances": _COUNT,
            "versions": {"type": "object", "additionalProperties": _TEXT},
            "pid": _COUNT,
        }
    ),
    "env_watch_key": _object({"key": _or_null(_TEXT), "seconds": _or_null(_COUNT)}),
    "env_watch_state": _object({"number": _or_null(_COUNT), "state": _TEXT}),
    "env_watch_presence": _object({"watched": _FLAG}),
}
