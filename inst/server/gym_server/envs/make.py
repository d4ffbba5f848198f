"""Make an environment from its id, and explain what is wrong with an unknown id."""

from __future__ import annotations

import contextlib
import copy
import importlib
from collections.abc import Callable, Collection, Iterator
from typing import Any, TypeVar, cast

import gymnasium
from gymnasium import error
from gymnasium.envs import registration

from gym_server import logs
from gym_server.envs import mujoco
from gym_server.envs.atari import classic_game
from gym_server.envs.config import EnvConfig
from gym_server.envs.extras import (
    extra_of,
    lacks_extra,
    missing_extra,
    unwrapped,
    why_unavailable,
)
from gym_server.envs.registry import LONGEST_ID, import_allowed, importing, look_up, near
from gym_server.envs.tuple_arguments import with_tuples
from gym_server.errors import GymServerError, environment_error, invalid_parameter
from gym_server.json_values import brief, parse_nonfinite

ResultT = TypeVar("ResultT")


def make_env(config: EnvConfig, allowed_modules: Collection[str]) -> gymnasium.Env:
    """Make an environment, without its wrappers.

    Args:
        config: what the client chose.
        allowed_modules: the modules that an id may import.

    Raises:
        GymServerError: ``malformed_env_id``, ``unknown_env_id``, ``deprecated_env_id``,
            ``module_not_allowed``, ``missing_dependency``, ``invalid_parameter`` (render_mode),
            ``invalid_kwargs``, ``not_supported``, ``too_much_memory``, ``environment_error``.
    """
    kwargs = config.kwargs or {}
    check_kwargs(kwargs)
    spec = find_spec(config.env_id, allowed_modules)
    with naming_extra(spec):
        chosen = choose_render_mode(load_creator(spec), spec, config.render_mode)
        return make_from_spec(spec, chosen, parse_nonfinite(kwargs))


def env_id_of(config: EnvConfig, gym_env: Any) -> str:
    """Return an id that creates the same environment: its module, and the version found."""
    module, colon, name = str(config.env_id).rpartition(":")
    return f"{module}{colon}{gym_env.spec.id if gym_env.spec else name}"


def check_kwargs(kwargs: dict) -> None:
    """Raise ``invalid_kwargs`` for an argument that is a request parameter."""
    if "render_mode" in kwargs:
        raise GymServerError(
            "invalid_kwargs",
            "'kwargs' must not contain 'render_mode'",
            "send render_mode as its own parameter",
        )


@contextlib.contextmanager
def naming_extra(spec: registration.EnvSpec) -> Iterator[None]:
    """Give the registry's reason in a ``missing_dependency`` error."""
    try:
        yield
    except GymServerError as refusal:
        reason = why_unavailable(spec) if refusal.code == "missing_dependency" else None
        if reason is None:
            raise
        extra = extra_of(spec)
        if extra is not None and lacks_extra(spec):
            raise missing_extra(spec.id, extra) from refusal
        raise GymServerError(
            "missing_dependency", f"{spec.id} cannot be made: {reason}", refusal.message
        ) from refusal


def find_spec(env_id: object, allowed_modules: Collection[str]) -> registration.EnvSpec:
    """Return the spec of an id; first import its module if it names one.

    Raises:
        GymServerError: as for ``make_env()``.
    """
    if not isinstance(env_id, str) or len(env_id) > LONGEST_ID:
        raise _malformed(brief(env_id))
    module, colon, name = env_id.rpartition(":")
    if registration.ENV_ID_RE.fullmatch(name) is None or (colon and not _is_module(module)):
        raise _malformed(env_id)
    if module and module not in allowed_modules:
        raise GymServerError(
            "module_not_allowed",
            f"This server may not import the module '{module}'",
            f"start the server with --allow-module {module}",
        )
    try:
        with importing:
            if module:
                call_env(importlib.import_module, module)
            elif allowed_modules and name not in gymnasium.registry:
                # One of these may register it.
                import_allowed(allowed_modules)
            spec = look_up(name)
    except error.Error as failure:
        raise _explain(failure, env_id, name) from failure
    _hear_of_version(spec, name)
    return spec


def _hear_of_version(spec: registration.EnvSpec, name: str) -> None:
    """Give the warnings of ``gymnasium.make()``, which gives none for a spec."""
    latest = registration.find_highest_version(spec.namespace, spec.name)
    if registration.parse_env_id(name)[2] is None and spec.version is not None:
        logs.hear(
            f"Using the latest versioned environment `{spec.id}` instead of the unversioned "
            f"environment `{name}`."
        )
    elif latest is not None and spec.version is not None and latest > spec.version:
        logs.hear(
            f"The environment {spec.id} is out of date. You should consider upgrading to version "
            f"`v{latest}`."
        )


def _is_module(text: str) -> bool:
    return all(part.isidentifier() for part in text.split("."))


def _explain(failure: error.Error, env_id: str, name: str) -> GymServerError:
    match failure:
        case error.DeprecatedEnv():
            return GymServerError(
                "deprecated_env_id", f"The environment '{env_id}' is deprecated", _use_latest(name)
            )
        case error.VersionNotFound():
            return GymServerError(
                "unknown_env_id",
                f"There is no such version of '{env_id}'",
                _use_namespace(name) or _use_latest(name),
            )
        case _:
            return GymServerError(
                "unknown_env_id",
                f"There is no environment '{env_id}'",
                _use_namespace(name) or _use_ale(name) or _did_you_mean(name),
            )


def _malformed(env_id: str) -> GymServerError:
    # This is the classic server's message.
    return GymServerError(
        "malformed_env_id", f"Attempted to look up malformed environment ID '{env_id}'"
    )


def _use_ale(name: str) -> str | None:
    game = classic_game(name)
    if game is None:
        return None
    env_id, shows_memory = game
    return f'use {env_id} with kwargs {{"obs_type": "ram"}}' if shows_memory else f"use {env_id}"


def _use_namespace(name: str) -> str | None:
    """Return the hint for an id whose namespace was left out, such as ``Breakout-v5``."""
    ids = [env_id for env_id in gymnasium.registry if env_id.partition("/")[2] == name]
    return f"use {' or '.join(ids)}" if ids else None


def _use_latest(name: str) -> str:
    namespace, bare_name, _ = registration.parse_env_id(name)
    latest = registration.find_highest_version(namespace, bare_name)
    return f"use {registration.get_env_id(namespace, bare_name, latest)}"


def _did_you_mean(name: str) -> str | None:
    ids = near(name)
    return f"did you mean {' or '.join(ids)}?" if ids else None


def load_creator(spec: registration.EnvSpec) -> Callable:
    """Import the class or function that makes an environment.

    Raises:
        GymServerError: ``missing_dependency``, ``not_supported``, ``environment_error``.
    """
    if spec.entry_point is None and spec.vector_entry_point is not None:
        raise GymServerError(
            "not_supported",
            f"{spec.id} is only a vector environment",
            "send num_envs, the number of sub-environments, and no vectorization_mode",
        )
    return call_env(_load_creator, spec)


def _load_creator(spec: registration.EnvSpec) -> Callable:
    with importing:
        importlib.import_module("gymnasium.wrappers")
        if callable(spec.entry_point):
            return spec.entry_point
        # If it is not callable, it is a string.
        entry_point = cast(str, spec.entry_point)
        if extra_of(spec) != "mujoco":
            return registration.load_env_creator(entry_point)
        mujoco.choose_gl()
        creator = registration.load_env_creator(entry_point)
        mujoco.log_warnings()
        mujoco.draw_in_own_context()
        return creator


def choose_render_mode(
    creator: Callable, spec: registration.EnvSpec, wanted: str | None
) -> str | None:
    """Return the render_mode for making an environment.

    Args:
        creator: its class or function; its metadata lists the render modes.
        spec: the environment's spec.
        wanted: the client's render_mode; see ``EnvConfig``.

    Raises:
        GymServerError: ``invalid_parameter``.
    """
    metadata = getattr(unwrapped(creator), "metadata", None)
    # A function has no metadata. Then Gymnasium handles the client's render_mode.
    modes = metadata.get("render_modes", []) if isinstance(metadata, dict) else None
    if wanted is None:
        return "rgb_array" if modes and "rgb_array" in modes else None
    if wanted not in ("rgb_array", "human") or (modes is not None and "rgb_array" not in modes):
        can_draw = modes is None or "rgb_array" in modes
        supported = '"rgb_array" or "human"' if can_draw else "left out"
        raise invalid_parameter("render_mode", wanted, f"{supported} for {spec.id}")
    return "rgb_array"


def make_from_spec(
    spec: registration.EnvSpec, render_mode: str | None, kwargs: dict
) -> gymnasium.Env:
    """Make an environment from its spec.

    Raises:
        GymServerError: ``missing_dependency``, ``invalid_kwargs``, ``environment_error``.
    """
    # The checker slows each step, and would fill the server's log.
    ours: dict[str, Any] = {"disable_env_checker": True}
    if render_mode is not None:
        ours["render_mode"] = render_mode
    given = with_tuples(load_creator(spec), kwargs)
    return call_env(_refusing_kwargs, lambda: gymnasium.make(spec, **{**ours, **given}), kwargs)


def vector_spec(spec: registration.EnvSpec) -> registration.EnvSpec:
    """Return a spec whose entry point is the vector implementation."""
    copied = copy.copy(spec)
    # The type is ignored because a vector environment is not an environment.
    copied.entry_point = spec.vector_entry_point  # type: ignore[assignment]
    return copied


def make_vector_entry_point(
    spec: registration.EnvSpec, kwargs: dict, ours: dict[str, Any]
) -> gymnasium.vector.VectorEnv:
    """Make an environment's own vector implementation.

    Args:
        spec: the environment's spec.
        kwargs: the client's arguments.
        ours: other arguments of ``gymnasium.make_vec()``.

    Raises:
        GymServerError: as for ``make_from_spec()``.
    """
    mode = "vector_entry_point"
    return call_env(
        _refusing_kwargs,
        lambda: gymnasium.make_vec(
            spec, vectorization_mode=mode, vector_kwargs={}, wrappers=(), **ours, **kwargs
        ),
        kwargs,
    )


def _refusing_kwargs(make: Callable[[], ResultT], kwargs: dict) -> ResultT:
    try:
        return make()
    except TypeError as failure:
        if kwargs and any(words in str(failure) for words in _ABOUT_ARGUMENTS):
            raise GymServerError("invalid_kwargs", str(failure)) from failure
        raise


_ABOUT_ARGUMENTS = ("unexpected keyword argument", "multiple values for", "required positional")


def call_env(function: Callable[..., ResultT], *args: object) -> ResultT:
    """Call a function of Gymnasium or of an environment; translate its exceptions.

    Raises:
        GymServerError: ``missing_dependency``, ``environment_error``, or the function's own
            GymServerError.
    """
    try:
        return function(*args)
    except GymServerError:
        raise
    except (error.DependencyNotInstalled, ImportError) as failure:
        raise GymServerError("missing_dependency", str(failure)) from failure
    except BaseException as failure:
        # Includes KeyboardInterrupt and SystemExit: a signal handler takes Ctrl-C, so only an
        # environment can raise them, and its client needs a response.
        raise environment_error(failure) from failure
