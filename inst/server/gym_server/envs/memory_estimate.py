"""Estimates of the memory that an environment will take, made before it takes it.

An estimate is the most that the environment and one answer in JSON need at the same time. The
figures for the environments themselves were measured as the growth of a process with each further
environment (Gymnasium 1.4, ale_py 0.12), and rounded up.
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

_KB, _MB = 2**10, 2**20

_TOY_TEXT = "gymnasium.envs.toy_text"
_MUJOCO = "gymnasium.envs.mujoco"

# By the beginning of the module's name, the more particular one before the more general one;
# environments of all others are small.
_ENVIRONMENT_BYTES = {
    f"{_TOY_TEXT}.taxi": 1 * _MB,
    _TOY_TEXT: 128 * _KB,
    "gymnasium.envs.box2d.car_racing": 5 * _MB,
    "gymnasium.envs.box2d": 512 * _KB,
    _MUJOCO: 2 * _MB,
    "ale_py": 2 * _MB,
}
_OTHER_ENVIRONMENT_BYTES = 16 * _KB

# What MuJoCo takes for each pixel when it draws a picture larger than usual: the figures above are
# of environments that nobody draws, and what drawing takes is measured afterwards (``Account``).
_PIXEL_BYTES = 72
_USUAL_PIXELS = 480 * 480

# A map of FrozenLake becomes a table of transitions, and each of its letters takes this much there.
# The figures above include arguments that are no longer than _FREE_ARGUMENT_LETTERS.
_ARGUMENT_LETTER_BYTES = 2 * _KB
_FREE_ARGUMENT_LETTERS = 64

# What a transition takes in the answer that holds all of them: in the columns, and while they are
# written as JSON. Of 20,000 and more of them each takes less.
_TRANSITION_BYTES = 544

# A wrapper's arguments may be arrays of bounds: the bytes per digit that they are written in.
_WRAPPER_LETTER_BYTES = 16
_WRAPPER_BYTES = 1 * _KB

# Each part of a space is an object, and there are three arrays of its size: its two bounds, and an
# observation.
_PART_BYTES = 512
_COPIES = 3

# What a number takes that is sent as JSON: an object in a list (Python keeps small integers in any
# case), its digits in a text, and again as bytes; and its two bounds as such objects in the space's
# description.
_SHORT_NUMBER_BYTES, _NUMBER_BYTES = 44 + 16, 80 + 64


def environment_bytes(spec: EnvSpec, kwargs: dict) -> float:
    """Estimate an environment without its observations."""
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
    """Estimate the answer that holds the transition model of an environment of Gymnasium's."""
    base: Any = env.unwrapped
    if not type(base).__module__.startswith(_TOY_TEXT) or not hasattr(base, "P"):
        return 0
    actions = [outcomes for by_action in base.P.values() for outcomes in by_action.values()]
    return _TRANSITION_BYTES * sum(map(len, actions))


def vector_bytes(spec: EnvSpec, kwargs: dict) -> float:
    """Estimate a sub-environment of an environment's own vector implementation."""
    if module_of(spec).partition(".")[0] != "ale_py":
        return environment_bytes(spec, kwargs)
    # Atari's implementation stacks pictures, whose size and number are arguments.
    sides = [_number(kwargs.get(f"img_{side}", 84)) for side in ("height", "width")]
    frames = _number(kwargs.get("stack_num", 4)) * (1 if kwargs.get("grayscale", True) else 3)
    return environment_bytes(spec, kwargs) + _COPIES * frames * math.prod(sides)


def answer_bytes(space: gymnasium.Space) -> float:
    """Estimate an observation of one sub-environment on its way to the client."""
    return sum(
        _PART_BYTES
        + _COPIES * elements * size
        + elements * (_NUMBER_BYTES if size > 1 else _SHORT_NUMBER_BYTES)
        for elements, size in _parts(space)
    )


def observation_bytes(space: gymnasium.Space) -> float:
    """Return how many bytes an observation has."""
    return sum(elements * size for elements, size in _parts(space))


class WrapperBytes(NamedTuple):
    """What a wrapper takes, in bytes: for as long as it exists, and for an answer."""

    kept: float
    answer: float


def wrapper_bytes(name: str, kwargs: dict, env: gymnasium.Env) -> WrapperBytes:
    """Estimate a wrapper around an environment, before it is made.

    Args:
        name: the wrapper's.
        kwargs: what it gets.
        env: what it is put around.
    """
    space = env.observation_space
    elements = sum(elements for elements, _ in _parts(space))
    observation = observation_bytes(space)
    queue = 0.0
    match name:
        case "FrameStackObservation":
            size = _number(kwargs.get("stack_size"))
            elements, observation = elements * size, observation * size
            # It keeps the last ones, and an array for all of them.
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
    """Return how many elements each part of a space has, and how many bytes one of them has."""
    waiting = [space]
    while waiting:
        match waiting.pop():
            case Dict() as one:
                waiting.extend(one.spaces.values())
            case Tuple() | OneOf() as one:
                waiting.extend(one.spaces)
            case Sequence() as one:
                waiting.append(one.feature_space)
            case Graph() as one:
                waiting.extend(part for part in (one.node_space, one.edge_space) if part)
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
    """Return how many pixels there are in a picture of a shape, or of the length of its sides."""
    sides = shape if isinstance(shape, list) else [shape, shape]
    return math.prod(map(_number, sides))


def _number(value: object) -> float:
    """Return an argument that should be a number; 0 for anything else, which is refused later."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return max(0, value)
    return 0
