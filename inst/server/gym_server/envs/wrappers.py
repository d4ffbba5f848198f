"""Gymnasium's wrappers around an environment, chosen by name at creation."""

from __future__ import annotations

import copy
import inspect
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import error

from gym_server.envs.argument_limits import check_wrapper
from gym_server.envs.config import Wrapper
from gym_server.envs.extras import missing_extra
from gym_server.envs.memory_estimate import answer_bytes, wrapper_bytes
from gym_server.envs.memory_reservation import MemoryReservation
from gym_server.errors import GymServerError
from gym_server.json_values import parse_nonfinite

# Wrappers whose arguments are numbers, texts and lists, and which keep one environment one
# environment and write no files.  Not among them: Autoreset, whose resets no client would see;
# wrappers that take functions or devices; wrappers that open windows.
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

# Arguments whose lists become arrays of a space's dtype. Gymnasium wants other lists as tuples.
_ARRAYS = {
    "min_action": "action_space",
    "max_action": "action_space",
    "min_obs": "observation_space",
    "max_obs": "observation_space",
}

# Each takes time in each step.
_MOST_WRAPPERS = 32

# Wrappers that draw when they are made and in each step.
_DRAWING = ("AddRenderObservation",)

# Wrappers that keep observations of earlier steps.
_KEEPING = ("DelayObservation", "FrameStackObservation")

# Wrappers that leave observations, actions and rewards as they are. The first two are Gymnasium's
# own additions.
_UNCHANGING = (
    gymnasium.wrappers.OrderEnforcing,
    gymnasium.wrappers.PassiveEnvChecker,
    gymnasium.wrappers.RecordEpisodeStatistics,
    gymnasium.wrappers.TimeLimit,
)

# Environments that draw their own observation, a picture, in each step.
_DRAWING_ENVIRONMENTS = ("gymnasium.envs.box2d.car_racing",)


class _CopiedObservations(gymnasium.ObservationWrapper):
    """Keeps an environment from changing in place what it has observed before."""

    def observation(self, observation: Any) -> Any:
        return copy.deepcopy(observation)


def allowed() -> list[str]:
    """Return the names of the wrappers that this Gymnasium has and a client may choose."""
    return [name for name in _ALLOWED if hasattr(gymnasium.wrappers, name)]


def check(wrappers: Sequence[Wrapper]) -> None:
    """Refuse a wrapper that is not on the list, and too many of them.

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
                f"The wrapper '{wrapper.name}' is none that this server takes",
                f"it takes {', '.join(allowed())}",
            )


def wrap(
    env: gymnasium.Env,
    wrappers: Sequence[Wrapper],
    renderer: Any,
    memory: MemoryReservation | None = None,
) -> gymnasium.Env:
    """Put wrappers around an environment, the first one innermost; see ``check()``.

    Args:
        env: the environment.
        wrappers: what is put around it.
        renderer: where wrappers that draw are made; a ``RenderThread``, or what stands for it.
        memory: what reserves the memory of the wrappers; None where it has been reserved.

    Raises:
        GymServerError: ``invalid_kwargs``, ``missing_dependency``, ``too_much_memory``.
    """
    for wrapper in wrappers:
        if wrapper.name in _DRAWING:
            env = renderer.run(_wrap, env, wrapper, memory)
        else:
            env = _wrap(env, wrapper, memory)
    if memory is not None:
        memory.reserve(answer_bytes(env.observation_space), "What is observed")
    return env


def time_limit(env: gymnasium.Env) -> int | None:
    """Return the smallest time limit of an environment and the wrappers around it, or None.

    The spec of each layer knows the outermost limit below it, so the specs of all layers together
    know every limit.
    """
    limits = [env.spec.max_episode_steps if env.spec else None]
    while isinstance(env, gymnasium.Wrapper):
        env = env.env
        limits.append(env.spec.max_episode_steps if env.spec else None)
    return min(filter(None, limits), default=None)


def changing_wrapper(env: gymnasium.Env) -> str | None:
    """Return the name of a wrapper that may change observations, actions or rewards, or None.

    That is the outermost one that is not known to leave them as they are.
    """
    base = env.unwrapped
    while env is not base:
        # Others may call theirs by the same names, or derive from them.
        if not isinstance(env, gymnasium.Wrapper) or type(env) not in _UNCHANGING:
            return type(env).__name__
        env = env.env
    return None


def draws_when_stepped(env: gymnasium.Env) -> bool:
    """Tell whether an environment draws in each reset and step, not only in ``render()``."""
    if type(env.unwrapped).__module__ in _DRAWING_ENVIRONMENTS:
        return True
    while isinstance(env, gymnasium.Wrapper):
        if type(env).__name__ in _DRAWING:
            return True
        env = env.env
    return False


def _wrap(env: gymnasium.Env, wrapper: Wrapper, memory: MemoryReservation | None) -> gymnasium.Env:
    kind = getattr(gymnasium.wrappers, wrapper.name)
    try:
        # Of two mistakes, an unknown argument and a missing one, the unknown one is reported.
        inspect.signature(kind).bind_partial(env, **wrapper.kwargs)
        inspect.signature(kind).bind(env, **wrapper.kwargs)
    except TypeError as failure:
        raise GymServerError("invalid_kwargs", f"{wrapper.name}: {failure}") from failure
    check_wrapper(wrapper)
    if memory is not None:
        estimate = wrapper_bytes(wrapper.name, parse_nonfinite(wrapper.kwargs), env)
        memory.reserve(estimate.kept, wrapper.name, later=estimate.answer)
    if wrapper.name in _KEEPING:
        env = _CopiedObservations(env)
    try:
        arguments = {name: _argument(env, name, value) for name, value in wrapper.kwargs.items()}
        wrapped: gymnasium.Env = kind(env, **arguments)
        return wrapped
    except error.DependencyNotInstalled as failure:
        # Wrappers that lack a dependency lack OpenCV, which this extra of ours installs.
        raise missing_extra(wrapper.name, "atari") from failure
    except Exception as failure:
        words = str(failure) or "it says no more"
        raise GymServerError(
            "invalid_kwargs",
            f"{wrapper.name} cannot wrap this environment: {type(failure).__name__}: {words}",
        ) from failure


def _argument(env: gymnasium.Env, name: str, value: object) -> object:
    value = parse_nonfinite(value)
    if isinstance(value, list):
        items = [_argument(env, name, item) for item in value]
        return _array(getattr(env, _ARRAYS[name]), items) if name in _ARRAYS else tuple(items)
    # Many wrappers insist on integers, and a client may write 4 as 4.0.
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _array(space: gymnasium.Space, items: list) -> np.ndarray:
    array = np.array(items)
    # Gymnasium would warn that precision is lost, where none is.
    is_float = space.dtype is not None and space.dtype.kind == "f"
    return array.astype(space.dtype) if is_float else array
