"""Estimates of the memory that an environment will need, before it is made.

An estimate covers the environment and one JSON response at the same time. The figures for the
environments were measured as the growth of a process per environment (Gymnasium 1.4, ale_py 0.12),
and rounded up.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import gymnasium
from gymnasium.envs.registration import EnvSpec
from gymnasium.spaces import Dict, Graph, OneOf, Sequence, Text, Tuple

from gym_server.envs.registry import module_of
from gym_server.spaces import parts_of

_KB, _MB = 2**10, 2**20

_TOY_TEXT = "gymnasium.envs.toy_text"
_MUJOCO = "gymnasium.envs.mujoco"

# By a prefix of the module's name, specific ones first. All other environments are small.
_ENVIRONMENT_BYTES = {
    f"{_TOY_TEXT}.taxi": 1 * _MB,
    _TOY_TEXT: 128 * _KB,
    "gymnasium.envs.box2d.car_racing": 5 * _MB,
    "gymnasium.envs.box2d": 512 * _KB,
    _MUJOCO: 2 * _MB,
    "ale_py": 2 * _MB,
}
_OTHER_ENVIRONMENT_BYTES = 16 * _KB

# MuJoCo's memory per pixel for pictures larger than usual. The figures above are of environments
# that are not drawn; the memory of drawing is measured afterwards (``Account``).
_PIXEL_BYTES = 72
_USUAL_PIXELS = 480 * 480

# A FrozenLake map becomes a table of transitions, which takes this much per letter. The figures
# above include arguments of up to _FREE_ARGUMENT_LETTERS.
_ARGUMENT_LETTER_BYTES = 2 * _KB
_FREE_ARGUMENT_LETTERS = 64

# The memory of a transition in the response that holds all of them: in columns, and while they are
# written as JSON. Measured for 20,000 and more, of which each takes less.
_TRANSITION_BYTES = 544

# A wrapper's arguments may be arrays of bounds: the bytes per written digit.
_WRAPPER_LETTER_BYTES = 16
_WRAPPER_BYTES = 1 * _KB

# Each part of a space is an object with three arrays of its size: two bounds and an observation.
_PART_BYTES = 512
_COPIES = 3

# The memory of a number sent as JSON: an object in a list (Python caches small integers), its
# digits as text and as bytes; and two such objects for its bounds in the space's description.
_SHORT_NUMBER_BYTES, _NUMBER_BYTES = 44 + 16, 80 + 64


def environment_bytes(spec: EnvSpec, kwargs: dict) -> float:
    """Estimate the memory of an environment without its observations."""
    module = module_of(spec)
    letters = len(json.dumps(kwargs, default=str))
    for beginning, size in _ENVIRONMENT_BYTES.items():
        if module.startswith(beginning):
            more = _ARGUMENT_LETTER_BYTES * max(0, letters - _FREE_ARGUMENT_LETTERS)
            return size + more + (_picture_bytes(kwargs) if beginning == _MUJOCO else 0)
    return _OTHER_ENVIRONMENT_BYTES + _WRAPPER_LETTER_BYTES * letters


def _picture_bytes(kwargs: dict) -> float:
    pixels = math.prod(_number(kwargs.get(side, 480)) for side in ("width", "height"))
    return _PIXEL_BYTES * max(0, pixels - _USUAL_PIXELS)


def model_bytes(env: gymnasium.Env) -> float:
    """Estimate the response with the transition model of one of Gymnasium's environments."""
    base: Any = env.unwrapped
    if not type(base).__module__.startswith(_TOY_TEXT) or not hasattr(base, "P"):
        return 0
    actions = [outcomes for by_action in base.P.values() for outcomes in by_action.values()]
    return _TRANSITION_BYTES * sum(map(len, actions))


def vector_bytes(spec: EnvSpec, kwargs: dict) -> float:
    """Estimate one sub-environment of an environment's own vector implementation."""
    if module_of(spec).partition(".")[0] != "ale_py":
        return environment_bytes(spec, kwargs)
    # Atari's implementation stacks pictures; their size and number are arguments.
    sides = [_number(kwargs.get(f"img_{side}", 84)) for side in ("height", "width")]
    frames = _number(kwargs.get("stack_num", 4)) * (1 if kwargs.get("grayscale", True) else 3)
    return environment_bytes(spec, kwargs) + _COPIES * frames * math.prod(sides)


def answer_bytes(space: gymnasium.Space) -> float:
    """Estimate an observation of one sub-environment, including its response."""
    return sum(
        _PART_BYTES
        + _COPIES * elements * size
        + elements * (_NUMBER_BYTES if size > 1 else _SHORT_NUMBER_BYTES)
        for elements, size in _parts(space)
    )


def observation_bytes(space: gymnasium.Space) -> float:
    """Return the size of an observation in bytes."""
    return sum(elements * size for elements, size in _parts(space))


class WrapperBytes(NamedTuple):
    """The memory of a wrapper in bytes: while it exists, and for a response."""

    kept: float
    answer: float


def wrapper_bytes(name: str, kwargs: dict, env: gymnasium.Env) -> WrapperBytes:
    """Estimate a wrapper before it is made.

    Args:
        name: the wrapper's name.
        kwargs: its arguments.
        env: the environment to wrap.
    """
    space = env.observation_space
    elements = sum(elements for elements, _ in _parts(space))
    observation = observation_bytes(space)
    queue = 0.0
    match name:
        case "FrameStackObservation":
            size = _number(kwargs.get("stack_size"))
            elements, observation = elements * size, observation * size
            # It keeps the last observations, and an array for all of them.
            queue = 2 * observation
        case "DelayObservation":
            queue = observation * _number(kwargs.get("delay"))
        case "ResizeObservation":
            elements = observation = _product(kwargs.get("shape")) * _channels(space)
        case "AtariPreprocessing":
            elements = 3 * _product(kwargs.get("screen_size", 84))
            observation = 4 * elements
        case "FlattenObservation" | "TimeAwareObservation":
            elements = 1 + _flat_elements(space)
            observation = 8 * elements
        case "DtypeObservation" | "NormalizeObservation":
            observation = queue = 16 * elements
        case "DiscretizeObservation":
            queue = 16 * _bins(kwargs.get("bins"), space)
        case "DiscretizeAction":
            queue = 16 * _bins(kwargs.get("bins"), env.action_space)
    letters = len(json.dumps(kwargs, default=str))
    objects = _WRAPPER_BYTES + _PART_BYTES * len(list(_parts(space)))
    return WrapperBytes(
        objects + _WRAPPER_LETTER_BYTES * letters + _COPIES * observation + queue,
        elements * (_NUMBER_BYTES if observation > elements else _SHORT_NUMBER_BYTES),
    )


def _parts(space: gymnasium.Space) -> Iterator[tuple[float, int]]:
    """Yield the number of elements of each part of a space, and the bytes of one element."""
    waiting = [space]
    while waiting:
        match waiting.pop():
            case Dict() | Tuple() | OneOf() | Sequence() | Graph() as one:
                waiting.extend(parts_of(one))
            case Text() as one:
                yield one.max_length, 4
            case one:
                dtype = one.dtype
                yield math.prod(map(int, one.shape or ())), dtype.itemsize if dtype else 8


def _flat_elements(space: gymnasium.Space) -> float:
    try:
        return gymnasium.spaces.flatdim(space)
    except (ValueError, NotImplementedError, OverflowError):
        # Making the wrapper will fail.
        return 0


def _bins(bins: object, space: gymnasium.Space) -> float:
    elements = sum(elements for elements, _ in _parts(space))
    return sum(map(_number, bins)) if isinstance(bins, list) else elements * _number(bins)


def _channels(space: gymnasium.Space) -> int:
    return math.prod((space.shape or ())[2:])


def _product(shape: object) -> float:
    """Return the number of pixels, given a picture's shape or the length of its sides."""
    sides = shape if isinstance(shape, list) else [shape, shape]
    return math.prod(map(_number, sides))


def _number(value: object) -> float:
    """Return an argument that should be a number; 0 for anything else, which is refused later."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return max(0, value)
    return 0
