"""Gymnasium's wrappers around an environment, chosen by name at creation."""

from __future__ import annotations

import copy
import inspect
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import error

from gym_server.envs.config import Wrapper
from gym_server.envs.extras import missing_extra
from gym_server.errors import GymServerError, lacks_memory
from gym_server.json_values import parse_nonfinite

# Wrappers whose arguments are numbers, strings and lists, that keep a single environment, and that
# write no files. Excluded are Autoreset, whose resets clients would not see, wrappers that take
# functions or devices, and wrappers that open windows.
_ALLOWED = (
    "AddRenderObservation",
    "AddWhiteNoise",
    "AtariPreprocessing",
    "ClipAction",
    "ClipReward",
    "DelayObservation",
    "DiscretizeAction",
    "DiscretizeObservation",
    "DtypeObservation",
    "FilterObservation",
    "FlattenObservation",
    "FrameStackObservation",
    "GrayscaleObservation",
    "MaxAndSkipObservation",
    "NormalizeObservation",
    "NormalizeReward",
    "ObstructView",
    "RecordEpisodeStatistics",
    "RepeatAction",
    "RescaleAction",
    "RescaleObservation",
    "ReshapeObservation",
    "ResizeObservation",
    "StickyAction",
    "TimeAwareObservation",
    "TimeLimit",
)

# Arguments whose lists become arrays of a space's dtype. Gymnasium expects other lists as tuples.
_ARRAYS = {
    "min_action": "action_space",
    "max_action": "action_space",
    "min_obs": "observation_space",
    "max_obs": "observation_space",
}

# Each wrapper slows each step.
_MOST_WRAPPERS = 32

# Wrappers that draw when they are made and in each step.
_DRAWING = ("AddRenderObservation",)

# Wrappers that keep observations of earlier steps.
_KEEPING = ("DelayObservation", "FrameStackObservation")

# Wrappers that do not change observations, actions or rewards. Gymnasium itself adds the first two.
_UNCHANGING = (
    gymnasium.wrappers.OrderEnforcing,
    gymnasium.wrappers.PassiveEnvChecker,
    gymnasium.wrappers.RecordEpisodeStatistics,
    gymnasium.wrappers.TimeLimit,
)

# Environments that draw their observation, a picture, in each step.
_DRAWING_ENVIRONMENTS = ("gymnasium.envs.box2d.car_racing",)


class _CopiedObservations(gymnasium.ObservationWrapper):
    """Copies observations, in case the environment changes them in place later."""

    def observation(self, observation: Any) -> Any:
        return copy.deepcopy(observation)


def allowed() -> list[str]:
    """Return the wrappers that a client may choose and that this Gymnasium has."""
    return [name for name in _ALLOWED if hasattr(gymnasium.wrappers, name)]


def check(wrappers: Sequence[Wrapper]) -> None:
    """Refuse wrappers that are not allowed, and too many wrappers.

    Raises:
        GymServerError: ``wrapper_not_allowed``, ``invalid_parameter``.
    """
    if len(wrappers) > _MOST_WRAPPERS:
        raise GymServerError(
            "invalid_parameter",
            f"The parameter 'wrappers' must be a list of at most {_MOST_WRAPPERS}, "
            f"not {len(wrappers)}",
        )
    for wrapper in wrappers:
        if wrapper.name not in allowed():
            raise GymServerError(
                "wrapper_not_allowed",
                f"This server does not allow the wrapper '{wrapper.name}'",
                f"it allows {', '.join(allowed())}",
            )


def wrap(env: gymnasium.Env, wrappers: Sequence[Wrapper], renderer: Any) -> gymnasium.Env:
    """Put wrappers around an environment, the first one innermost; see ``check()``.

    Args:
        env: the environment.
        wrappers: the wrappers.
        renderer: the ``RenderThread`` for wrappers that draw, or a substitute.

    Raises:
        GymServerError: ``invalid_kwargs``, ``missing_dependency``, ``too_much_memory``.
    """
    for wrapper in wrappers:
        draws = wrapper.name in _DRAWING
        env = renderer.run(_wrap, env, wrapper) if draws else _wrap(env, wrapper)
    return env


def time_limit(env: gymnasium.Env) -> int | None:
    """Return the smallest time limit of an environment and its wrappers, or None.

    Each layer's spec has the outermost limit below it, so all specs together have every limit.
    """
    limits = [env.spec.max_episode_steps if env.spec else None]
    while isinstance(env, gymnasium.Wrapper):
        env = env.env
        limits.append(env.spec.max_episode_steps if env.spec else None)
    return min(filter(None, limits), default=None)


def changing_wrapper(env: gymnasium.Env) -> str | None:
    """Return the outermost wrapper that may change observations, actions or rewards, or None.

    Unknown wrappers are assumed to do so.
    """
    base = env.unwrapped
    while env is not base:
        # Compare types exactly: other wrappers may have the same name, or be subclasses.
        if not isinstance(env, gymnasium.Wrapper) or type(env) not in _UNCHANGING:
            return type(env).__name__
        env = env.env
    return None


def draws_when_stepped(env: gymnasium.Env) -> bool:
    """Return whether an environment draws in each reset and step, not only in ``render()``."""
    if type(env.unwrapped).__module__ in _DRAWING_ENVIRONMENTS:
        return True
    while isinstance(env, gymnasium.Wrapper):
        if type(env).__name__ in _DRAWING:
            return True
        env = env.env
    return False


def _wrap(env: gymnasium.Env, wrapper: Wrapper) -> gymnasium.Env:
    kind = getattr(gymnasium.wrappers, wrapper.name)
    try:
        # bind_partial() first: report an unknown argument before a missing one.
        inspect.signature(kind).bind_partial(env, **wrapper.kwargs)
        inspect.signature(kind).bind(env, **wrapper.kwargs)
    except TypeError as failure:
        raise GymServerError("invalid_kwargs", f"{wrapper.name}: {failure}") from failure
    if wrapper.name in _KEEPING:
        env = _CopiedObservations(env)
    try:
        arguments = {name: _argument(env, name, value) for name, value in wrapper.kwargs.items()}
        wrapped: gymnasium.Env = kind(env, **arguments)
        return wrapped
    except error.DependencyNotInstalled as failure:
        # The only dependency that these wrappers may lack is OpenCV, which this extra installs.
        raise missing_extra(wrapper.name, "atari") from failure
    except Exception as failure:
        if lacks_memory(failure):
            raise
        words = str(failure) or "no reason given"
        raise GymServerError(
            "invalid_kwargs",
            f"{wrapper.name} cannot wrap this environment: {type(failure).__name__}: {words}",
        ) from failure


def _argument(env: gymnasium.Env, name: str, value: object) -> object:
    value = parse_nonfinite(value)
    if isinstance(value, list):
        items = [_argument(env, name, item) for item in value]
        return _array(getattr(env, _ARRAYS[name]), items) if name in _ARRAYS else tuple(items)
    # Many wrappers insist on integers, and a client may send 4 as 4.0.
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _array(space: gymnasium.Space, items: list) -> np.ndarray:
    array = np.array(items)
    # Otherwise Gymnasium warns about lost precision, even if none is lost.
    is_float = space.dtype is not None and space.dtype.kind == "f"
    return array.astype(space.dtype) if is_float else array
