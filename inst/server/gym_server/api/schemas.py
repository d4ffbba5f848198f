"""JSON schemas for the routes' responses."""

from __future__ import annotations

TEXT = {"type": "string"}
FLAG = {"type": "boolean"}
COUNT = {"type": "integer", "minimum": 0}
SECONDS = {"type": "number", "minimum": 0}
ANYTHING: dict = {}
SPACE = {"type": "object", "required": ["name"], "properties": {"name": TEXT}}
# One value, or with sub-environments one for each. Non-finite numbers are strings.
NUMBER = {"anyOf": [{"type": "number"}, {"enum": ["NaN", "Infinity", "-Infinity"]}]}
NUMBERS = {"anyOf": [*NUMBER["anyOf"], {"type": "array", "items": NUMBER}]}
FLAGS = {"anyOf": [FLAG, {"type": "array", "items": FLAG}]}


def or_null(schema: dict) -> dict:
    """Return a schema that also accepts null."""
    return {"anyOf": [schema, {"type": "null"}]}


def array_of(items: dict) -> dict:
    """Return the schema of a list."""
    return {"type": "array", "items": items}


def json_object(required: dict[str, dict], **others: dict) -> dict:
    """Return the schema of an object with required properties, and others."""
    return {
        "type": "object",
        "required": list(required),
        "properties": {**required, **others},
    }


REQUEST = json_object({"key": TEXT, "number": COUNT})

LISTED_INSTANCE = {
    "instance_id": TEXT,
    "env_id": TEXT,
    "name": or_null(TEXT),
    "num_envs": or_null(COUNT),
    "age_seconds": SECONDS,
    "idle_seconds": SECONDS,
    "steps": COUNT,
    "watched": FLAG,
}

ABOUT_INSTANCE = {
    **LISTED_INSTANCE,
    "observation_space": SPACE,
    "action_space": SPACE,
    "reward_threshold": or_null(NUMBER),
    "max_episode_steps": or_null(COUNT),
    "render_fps": ANYTHING,
    "vectorization_mode": or_null(TEXT),
    "num_workers": or_null(COUNT),
    "autoreset_mode": or_null(TEXT),
    "render_mode": or_null(TEXT),
    "kwargs": {"type": "object"},
    "wrappers": {"type": "array", "items": {"type": "object"}},
    "seed": ANYTHING,
    "episode_steps": or_null(COUNT),
    "needs_reset": FLAG,
    "monitor": or_null({"type": "object"}),
    "isolated": FLAG,
}

LISTED_ENVIRONMENT = json_object(
    {
        "id": TEXT,
        "max_episode_steps": or_null(COUNT),
        "reward_threshold": or_null(NUMBER),
        "vectorised": FLAG,
        "extra": or_null(TEXT),
        "available": FLAG,
        "reason": or_null(TEXT),
    }
)

PROBABILITY = {"type": "number", "minimum": 0}

TRANSITION_MODEL = json_object(
    {
        "num_states": COUNT,
        "num_actions": COUNT,
        "start": array_of(PROBABILITY),
        "state": array_of(COUNT),
        "action": array_of(COUNT),
        "next_state": array_of(COUNT),
        "probability": array_of(PROBABILITY),
        "reward": array_of({"type": "number"}),
        "terminated": array_of(FLAG),
    }
)

MEMBER = json_object({"member": FLAG})
SPACE_INFO = json_object({"info": SPACE})
