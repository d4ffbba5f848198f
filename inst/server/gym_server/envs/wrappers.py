"""Gymnasium's wrappers around an environment, chosen by name at creation."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import NamedTuple

import gymnasium
import numpy as np
from gymnasium import error

from gym_server.envs.extras import missing_extra
from gym_server.envs.footprint import Account, answer_bytes, reckon_wrapper
from gym_server.errors import GymServerError
from gym_server.json_values import brief, from_words
from gym_server.rendering.render_thread import RenderThread

# Those that take numbers, texts and lists, keep one environment one environment, and write no
# files.  (Not: Autoreset, whose resets nobody would see; what takes functions or devices; what
# opens windows.)
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

# Arguments whose lists are arrays, of a space's dtype; Gymnasium wants other lists as tuples.
_ARRAYS = {
    "min_action": "action_space",
    "max_action": "action_space",
    "min_obs": "observation_space",
    "max_obs": "observation_space",
}

# What takes room by the number that it is given: one client must not use up the machine.
_AT_MOST = {
    "AtariPreprocessing": {"screen_size": 4_096},
    "DelayObservation": {"delay": 1_000},
    "DiscretizeAction": {"bins": 10_000},
    "DiscretizeObservation": {"bins": 10_000},
    "FrameStackObservation": {"stack_size": 1_000},
    "ResizeObservation": {"shape": 4_096},
}

# One in another: each takes its time in each step.
_MOST_WRAPPERS = 32

# They draw when they are made and in each step.
_DRAWING = ("AddRenderObservation",)

# Environments whose observation is a picture that they draw themselves, in each step.
_DRAWING_ENVIRONMENTS = ("gymnasium.envs.box2d.car_racing",)


class Wrapper(NamedTuple):
    """A wrapper that a client chose."""

    name: str
    kwargs: dict


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
    renderer: RenderThread,
    account: Account | None = None,
) -> gymnasium.Env:
    """Put wrappers around an environment, the first one innermost; see ``check()``.

    Args:
        env: the environment.
        wrappers: what is put around it.
        renderer: where wrappers that draw are made.
        account: what memory is charged to, before it is taken; None where it has been.

    Raises:
        GymServerError: ``invalid_kwargs``, ``missing_dependency``, ``too_much_memory``.
    """
    for wrapper in wrappers:
        drawing = wrapper.name in _DRAWING
        how = env, wrapper, account
        env = renderer.run(_wrap, *how) if drawing else _wrap(*how)
    if account is not None:
        account.charge(answer_bytes(env.observation_space), "What is observed")
    return env


def time_limit(env: gymnasium.Env) -> int | None:
    """Return the smallest time limit of an environment and the wrappers around it, or None.

    Each layer's spec tells the outermost limit from there inwards, and all of them are counted.
    """
    limits = [env.spec.max_episode_steps if env.spec else None]
    while isinstance(env, gymnasium.Wrapper):
        env = env.env
        limits.append(env.spec.max_episode_steps if env.spec else None)
    return min(filter(None, limits), default=None)


def draws_when_stepped(env: gymnasium.Env) -> bool:
    """Tell whether an environment draws in each reset and step, not only in ``render()``."""
    if type(env.unwrapped).__module__ in _DRAWING_ENVIRONMENTS:
        return True
    while isinstance(env, gymnasium.Wrapper):
        if type(env).__name__ in _DRAWING:
            return True
        env = env.env
    return False


def _wrap(env: gymnasium.Env, wrapper: Wrapper, account: Account | None) -> gymnasium.Env:
    kind = getattr(gymnasium.wrappers, wrapper.name)
    try:
        # What it does not know says more than what is missing.
        inspect.signature(kind).bind_partial(env, **wrapper.kwargs)
        inspect.signature(kind).bind(env, **wrapper.kwargs)
    except TypeError as failure:
        raise GymServerError("invalid_kwargs", f"{wrapper.name}: {failure}") from failure
    _check_sizes(wrapper)
    if account is not None:
        reckoned = reckon_wrapper(wrapper.name, from_words(wrapper.kwargs), env)
        account.charge(reckoned.kept, wrapper.name, reckoned.answer)
    try:
        return kind(
            env, **{name: _argument(env, name, value) for name, value in wrapper.kwargs.items()}
        )
    except error.DependencyNotInstalled as failure:
        # All of them need OpenCV, which no extra of Gymnasium's own brings alone.
        raise missing_extra(wrapper.name, "atari") from failure
    except Exception as failure:
        words = str(failure) or "it says no more"
        raise GymServerError(
            "invalid_kwargs",
            f"{wrapper.name} cannot wrap this environment: {type(failure).__name__}: {words}",
        ) from failure


def _check_sizes(wrapper: Wrapper) -> None:
    for name, most in _AT_MOST.get(wrapper.name, {}).items():
        value = from_words(wrapper.kwargs.get(name))
        for number in value if isinstance(value, list) else [value]:
            if isinstance(number, (int, float)) and not number <= most:
                raise GymServerError(
                    "invalid_kwargs",
                    f"{wrapper.name}: {name} must be at most {most}, not {brief(number)}",
                )


def _argument(env: gymnasium.Env, name: str, value: object) -> object:
    value = from_words(value)
    if isinstance(value, list):
        items = [_argument(env, name, item) for item in value]
        return _array(getattr(env, _ARRAYS[name]), items) if name in _ARRAYS else tuple(items)
    # Many of them insist on integers, which a client may write as 4.0.
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _array(space: gymnasium.Space, items: list) -> np.ndarray:
    array = np.array(items)
    # Gymnasium warns of precision lost where nothing is.
    is_float = space.dtype is not None and space.dtype.kind == "f"
    return array.astype(space.dtype) if is_float else array
