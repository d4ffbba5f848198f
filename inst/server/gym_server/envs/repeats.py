"""How many steps of its environment one call may take, and how large arguments may be.

Arguments that say how often something is done make a loop. One in Python goes on until the limit of
time breaks it off, and slows everybody meanwhile; one in an environment's own C code nothing breaks
off in the server's process. So the loops themselves are limited.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import gymnasium
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import VectorEnv

from gym_server.envs.registry import KNOWN_PACKAGES, module_of
from gym_server.errors import GymServerError
from gym_server.json_values import brief, from_words

if TYPE_CHECKING:
    from gym_server.envs.wrappers import Wrapper

# Of one environment, with all its repeats in one another.
MOST_REPEATS = 1_000

# Of all sub-environments: half a minute of the slow ones, and the usual 30 idle steps after the
# reset of as many of Atari's as one environment may have.
MOST_STEPS = 500_000

# The arguments that repeat steps, by wrapper.
_REPEATING = {
    "AtariPreprocessing": ("frame_skip", "noop_max"),
    "MaxAndSkipObservation": ("skip",),
    "RepeatAction": ("num_repeats",),
}

# As above, of the environments that run in the server's process: MuJoCo's and Atari's.
_REPEATING_ARGUMENTS = ("frame_skip", "frameskip", "noop_max")

# What else takes room or time by the number that it is given: the size of MuJoCo's pictures and
# what they show, Atari's own vector environment.
_AT_MOST = {
    "width": 4_096,
    "height": 4_096,
    "max_geom": 100_000,
    "img_width": 1_024,
    "img_height": 1_024,
    "stack_num": 64,
    "num_threads": 64,
    "batch_size": 16_384,
}

# A map of FrozenLake of 250 x 250, which takes a second to be made.
_LONGEST_ARGUMENTS = 65_536

# It turns an angle back by one round after the other, as often as it takes.
_TURNING = "gymnasium.envs.classic_control.acrobot"
_LARGEST_ANGLE = 100_000


def check(spec: EnvSpec, kwargs: dict, wrappers: Sequence[Wrapper], num_envs: int = 1) -> None:
    """Refuse arguments that are too large, and repeats that make one call too many steps.

    Args:
        spec: of the environment.
        kwargs: its arguments.
        wrappers: what will be put around it.
        num_envs: how many sub-environments a call steps.

    Raises:
        GymServerError: ``invalid_kwargs``.
    """
    if _is_known(spec):
        _check_arguments(kwargs)
    _check_steps(spec, kwargs, wrappers, num_envs)


def check_options(env: gymnasium.Env | VectorEnv, options: dict | None) -> None:
    """Refuse options of a reset that make a loop.

    Raises:
        GymServerError: ``invalid_parameter``.
    """
    spec = env.spec if options else None
    if spec is None or module_of(spec) != _TURNING:
        return
    for name in ("low", "high"):
        value = options.get(name)
        if isinstance(value, (int, float)) and abs(value) > _LARGEST_ANGLE:
            raise GymServerError(
                "invalid_parameter",
                f"The option '{name}' of {spec.id} must be between {-_LARGEST_ANGLE:,} and "
                f"{_LARGEST_ANGLE:,}, not {brief(value)}",
            )


def _check_arguments(kwargs: dict) -> None:
    letters = len(json.dumps(kwargs, default=str))
    if letters > _LONGEST_ARGUMENTS:
        raise GymServerError(
            "invalid_kwargs",
            f"kwargs must be of at most {_LONGEST_ARGUMENTS:,} characters of JSON, not {letters:,}",
        )
    for name, most in _AT_MOST.items():
        if _largest(kwargs.get(name)) > most:
            raise GymServerError(
                "invalid_kwargs", f"{name} must be at most {most}, not {brief(kwargs[name])}"
            )


def _check_steps(spec: EnvSpec, kwargs: dict, wrappers: Sequence[Wrapper], num_envs: int) -> None:
    arguments = [(kwargs, _REPEATING_ARGUMENTS)] if _is_known(spec) else []
    arguments += [(one.kwargs, _REPEATING.get(one.name, ())) for one in wrappers]
    said = [(name, given[name]) for given, names in arguments for name in names if name in given]
    repeats = math.prod(
        max([1, *(_largest(given.get(name)) for name in names)]) for given, names in arguments
    )
    if repeats > MOST_REPEATS or (repeats > 1 and repeats * num_envs > MOST_STEPS):
        raise GymServerError(
            "invalid_kwargs",
            f"One call would take {_counted(repeats * num_envs)} steps, by "
            + ", ".join(f"{name} {brief(value)}" for name, value in said)
            + (f" and {num_envs} sub-environments" if num_envs > 1 else ""),
            f"it may take {MOST_REPEATS:,} of one environment, {MOST_STEPS:,} of all its "
            "sub-environments; repeat less and step more often",
        )


def _is_known(spec: EnvSpec) -> bool:
    # What another one's arguments mean is not known; by default it has a process of its own.
    return module_of(spec).partition(".")[0] in KNOWN_PACKAGES


def _largest(value: object) -> float:
    """Return the largest number of an argument, which may be a list of them; 0 for none."""
    value = from_words(value)
    items = value if isinstance(value, list) else [value]
    # Any larger ones are as bad, and not every integer can be multiplied by every float.
    return max((min(one, 10**18) for one in items if isinstance(one, (int, float))), default=0)


def _counted(number: float) -> str:
    return f"{number:,}" if number < 10**15 else "more than 10^15"
