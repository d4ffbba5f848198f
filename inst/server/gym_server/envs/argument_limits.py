"""How large arguments may be, and how many steps of an environment one call may take.

Some arguments set how often something is repeated. A long loop in Python runs until the time limit
ends it, and slows all other calls meanwhile. A loop in an environment's C code cannot be ended in
the server's process at all. So the number of repeats is limited.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence

import gymnasium
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import VectorEnv

from gym_server.envs.config import Wrapper
from gym_server.envs.registry import is_known, module_of
from gym_server.errors import GymServerError
from gym_server.json_values import brief, parse_nonfinite

# Per environment; the repeats of several wrappers multiply.
MOST_REPEATS = 1_000

# Over all sub-environments: half a minute for slow ones. It allows the largest vector environment
# of Atari games with the usual 30 no-op steps after a reset.
MOST_STEPS = 500_000

# The arguments that repeat steps, by wrapper.
_REPEATING = {
    "AtariPreprocessing": ("frame_skip", "noop_max"),
    "MaxAndSkipObservation": ("skip",),
    "RepeatAction": ("num_repeats",),
}

# The arguments that repeat steps, of environments that run in the server's process: MuJoCo's and
# Atari's.
_REPEATING_ARGUMENTS: tuple[str, ...] = ("frame_skip", "frameskip", "noop_max")

# The bounds of arguments that take memory or time in proportion to their value: the size and
# contents of MuJoCo's pictures, and Atari's own vector environment, which hangs if a picture or
# stack has no size.
_ENVIRONMENT_LIMITS = {
    "width": (1, 4_096),
    "height": (1, 4_096),
    "max_geom": (1, 100_000),
    "img_width": (1, 1_024),
    "img_height": (1, 1_024),
    "stack_num": (1, 64),
    "num_threads": (0, 64),
}

# The largest such arguments of wrappers. Wrappers themselves check for too small ones.
_WRAPPER_LIMITS = {
    "AtariPreprocessing": ("screen_size", 4_096),
    "DelayObservation": ("delay", 1_000),
    "DiscretizeAction": ("bins", 10_000),
    "DiscretizeObservation": ("bins", 10_000),
    "FrameStackObservation": ("stack_size", 1_000),
    "ResizeObservation": ("shape", 4_096),
}

# Fits a FrozenLake map of 250 x 250, which takes a second to make.
_LONGEST_ARGUMENTS = 65_536

# Acrobot brings an angle into range one turn at a time, however many turns that takes.
_TURNING = "gymnasium.envs.classic_control.acrobot"
_LARGEST_ANGLE = 100_000


def check_environment(
    spec: EnvSpec, kwargs: dict, wrappers: Sequence[Wrapper], num_envs: int = 1
) -> None:
    """Refuse arguments that are too large, and repeats that make one call take too many steps.

    Args:
        spec: the environment's spec.
        kwargs: its arguments.
        wrappers: the wrappers to put around it.
        num_envs: how many sub-environments a call steps.

    Raises:
        GymServerError: ``invalid_kwargs``.
    """
    # The meaning of other environments' arguments is unknown. By default these run in their own
    # process.
    if is_known(module_of(spec)):
        _check_length(kwargs)
        # A step of Atari's own vector environment waits for this many sub-environments.
        _check_sizes(kwargs, {**_ENVIRONMENT_LIMITS, "batch_size": (num_envs, num_envs)})
    _check_steps(spec, kwargs, wrappers, num_envs)


def check_wrapper(wrapper: Wrapper) -> None:
    """Refuse arguments of a wrapper that are too large.

    Raises:
        GymServerError: ``invalid_kwargs``.
    """
    if wrapper.name in _WRAPPER_LIMITS:
        name, most = _WRAPPER_LIMITS[wrapper.name]
        _check_sizes(wrapper.kwargs, {name: (-math.inf, most)}, f"{wrapper.name}: ")


def check_reset_options(env: gymnasium.Env | VectorEnv, options: dict | None) -> None:
    """Refuse reset options that cause a long loop.

    Raises:
        GymServerError: ``invalid_parameter``.
    """
    if not options or env.spec is None or module_of(env.spec) != _TURNING:
        return
    for name in ("low", "high"):
        value = options.get(name)
        if isinstance(value, (int, float)) and abs(value) > _LARGEST_ANGLE:
            raise GymServerError(
                "invalid_parameter",
                f"The option '{name}' of {env.spec.id} must be between {-_LARGEST_ANGLE:,} and "
                f"{_LARGEST_ANGLE:,}, not {brief(value)}",
            )


def _check_length(kwargs: dict) -> None:
    length = len(json.dumps(kwargs, default=str))
    if length > _LONGEST_ARGUMENTS:
        raise GymServerError(
            "invalid_kwargs",
            f"'kwargs' may have at most {_LONGEST_ARGUMENTS:,} characters of JSON, not {length:,}",
        )


def _check_sizes(kwargs: dict, limits: Mapping[str, tuple[float, int]], prefix: str = "") -> None:
    """Refuse arguments that are out of bounds; the message starts with the prefix."""
    for name, (least, most) in limits.items():
        for number in _numbers(kwargs.get(name)):
            # Refuses NaN, too.
            if not least <= number <= most:
                must = f"at least {least}" if number < least else f"at most {most}"
                raise GymServerError(
                    "invalid_kwargs", f"{prefix}'{name}' must be {must}, not {brief(number)}"
                )


def _check_steps(spec: EnvSpec, kwargs: dict, wrappers: Sequence[Wrapper], num_envs: int) -> None:
    arguments = [(kwargs, _REPEATING_ARGUMENTS)] if is_known(module_of(spec)) else []
    arguments += [(one.kwargs, _REPEATING.get(one.name, ())) for one in wrappers]
    given = [(name, owner[name]) for owner, names in arguments for name in names if name in owner]
    repeats = math.prod(
        max([1, *(_largest(owner.get(name)) for name in names)]) for owner, names in arguments
    )
    if repeats > MOST_REPEATS or (repeats > 1 and repeats * num_envs > MOST_STEPS):
        raise GymServerError(
            "invalid_kwargs",
            f"One call would take {_formatted(repeats * num_envs)} steps, by "
            + ", ".join(f"{name} {brief(value)}" for name, value in given)
            + (f" and {num_envs} sub-environments" if num_envs > 1 else ""),
            f"at most {MOST_REPEATS:,} are allowed for one environment, {MOST_STEPS:,} for all "
            "sub-environments; repeat less and step more often",
        )


def _numbers(value: object) -> Iterator[float]:
    """Return the numbers in an argument, which may be a list."""
    value = parse_nonfinite(value)
    items = value if isinstance(value, list) else [value]
    return (item for item in items if isinstance(item, (int, float)))


def _largest(value: object) -> float:
    """Return the largest number in an argument; 0 if there is none."""
    # 10**18 stands for all larger numbers, because a large integer times a float may overflow.
    return max((min(number, 10**18) for number in _numbers(value)), default=0)


def _formatted(number: float) -> str:
    return f"{number:,}" if number < 10**15 else "more than 10^15"
