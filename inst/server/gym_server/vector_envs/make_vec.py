"""Make a vector environment in the requested mode, or in the fastest mode that works."""

from __future__ import annotations

import copy
import logging
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, cast

from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, VectorEnv

from gym_server.envs import make
from gym_server.envs.config import EnvConfig
from gym_server.envs.extras import extra_of
from gym_server.envs.registry import is_known, module_of
from gym_server.envs.tuple_arguments import parameters_of, with_tuples
from gym_server.errors import GymServerError, invalid_parameter, wrong_length
from gym_server.json_values import parse_nonfinite
from gym_server.rendering.render_thread import RenderThread
from gym_server.vector_envs.entry_point import EntryPointEnv, resets_each, why_seed_too_large
from gym_server.vector_envs.num_workers import choose_num_workers
from gym_server.vector_envs.sub_env import SubEnv
from gym_server.vector_envs.sub_envs import SubEnvs

log = logging.getLogger(__name__)

# Environments whose own vector implementation plays like the single one. Atari's has different
# observations, and Gymnasium's JAX environments are not faster with theirs: their sub-environments
# share what was compiled (copies.py), and theirs compiles anew for each number of episodes that end
# together.
_SAME_TASK = ("gymnasium.envs.classic_control.",)

# Arguments of make_vec() that may be registered with an environment.
_REGISTERED_BESIDE = ("num_envs", "vectorization_mode")


def make_vector_env(
    config: EnvConfig,
    allowed_modules: Collection[str],
    max_num_envs: int,
    renderer: RenderThread,
) -> tuple[EntryPointEnv | SubEnvs, str]:
    """Make a vector environment.

    Args:
        config: what the client chose, with a num_envs and allowed wrappers.
        allowed_modules: as for ``make.make_env()``.
        max_num_envs: the server's limit of sub-environments.
        renderer: the process's render thread.

    Returns:
        The vector environment, and its vectorization_mode.

    Raises:
        GymServerError: as for ``make.make_env()``; ``too_many_sub_envs``, ``too_much_memory``,
            ``not_supported``.
    """
    make.check_kwargs(config.kwargs or {})
    spec = make.find_spec(config.env_id, allowed_modules)
    _check(config, cast(int, config.num_envs), max_num_envs)
    request = _request(spec, config, renderer)
    with make.naming_extra(spec):
        # Some environments have nothing else.
        only = "vector_entry_point" if spec.entry_point is None else None
        match config.vectorization_mode or only:
            case None:
                own = _try_entry_point(request) if _is_the_same_task(request) else None
                if own is None:
                    return _make_sub_envs(request)
                env = own
            case "sync" | "async":
                return _make_sub_envs(request)
            case _:
                env = _require_entry_point(request)
        return EntryPointEnv(env, renderer), "vector_entry_point"


def make_own_implementation(
    config: EnvConfig, allowed_modules: Collection[str], renderer: Any
) -> VectorEnv | None:
    """Make an environment's own vector implementation; see ``make_vector_env()``.

    Returns:
        The vector environment; None if there is none that is known to play like the single one.
    """
    make.check_kwargs(config.kwargs or {})
    request = _request(make.find_spec(config.env_id, allowed_modules), config, renderer)
    return _try_entry_point(request) if _is_the_same_task(request) else None


def _request(spec: EnvSpec, config: EnvConfig, renderer: Any) -> _Request:
    kwargs, num_envs = config.kwargs or {}, cast(int, config.num_envs)
    # What was asked for counts. Gymnasium would take the registered values instead.
    spec = copy.copy(spec)
    spec.kwargs = {k: v for k, v in spec.kwargs.items() if k not in _REGISTERED_BESIDE}
    return _Request(spec, config, parse_nonfinite(kwargs), num_envs, renderer)


@dataclass(frozen=True)
class _Request:
    """The arguments of the functions below."""

    spec: EnvSpec
    config: EnvConfig
    kwargs: dict
    num_envs: int
    renderer: Any

    @property
    def autoreset_mode(self) -> AutoresetMode:
        return self.config.autoreset_mode or AutoresetMode.NEXT_STEP


def check_single(config: EnvConfig) -> None:
    """Raise ``invalid_parameter`` for parameters that only vector environments have."""
    of_vector_environments = {
        "num_workers": config.num_workers,
        "vectorization_mode": config.vectorization_mode,
        "autoreset_mode": config.autoreset_mode,
        "seed": config.seed if isinstance(config.seed, tuple) else None,
    }
    for name, value in of_vector_environments.items():
        if value is not None:
            what = "A list as 'seed'" if name == "seed" else f"The parameter '{name}'"
            raise GymServerError(
                "invalid_parameter",
                f"{what} is for vector environments, and 'num_envs' was not provided",
                "send num_envs, the number of sub-environments, which may also be 1",
            )


def _check(config: EnvConfig, num_envs: int, max_num_envs: int) -> None:
    if isinstance(config.seed, tuple) and len(config.seed) != num_envs:
        raise wrong_length("seed", len(config.seed), num_envs, "integer or null")
    if num_envs > max_num_envs:
        raise GymServerError(
            "too_many_sub_envs",
            f"This server allows at most {max_num_envs} sub-environments, not {num_envs}",
            "create several environments",
        )
    if config.num_workers is not None:
        _check_num_workers(config, config.num_workers, num_envs)


def _check_num_workers(config: EnvConfig, num_workers: int, num_envs: int) -> None:
    fits = {"sync": num_workers == 0, "async": num_workers > 0, "vector_entry_point": False}
    mode = config.vectorization_mode
    if mode is not None and not fits[mode]:
        wanted = (
            "0 with vectorization_mode 'sync', at least 1 with 'async', and left out with "
            "'vector_entry_point', which runs in the server's process"
        )
        raise invalid_parameter("num_workers", num_workers, wanted)
    if num_workers > num_envs:
        raise invalid_parameter(
            "num_workers", num_workers, f"at most {num_envs}, the number of sub-environments"
        )


# An environment's own implementation --------------------------------------------------------


def _why_no_entry_point(request: _Request) -> str | None:
    """Return why the environment's own implementation cannot be used, if known in advance."""
    if request.spec.vector_entry_point is None:
        return f"{request.spec.id} has none"
    if request.config.num_workers is not None:
        return "it runs in the server's process, and num_workers was given"
    if request.config.wrappers or request.spec.additional_wrappers:
        return "it supports no wrappers"
    if request.kwargs.get("max_episode_steps", 1) in (-1, None):
        return "it always has a time limit"
    if extra_of(request.spec) == "jax" and request.config.render_mode is not None:
        return "Gymnasium cannot draw its sub-environments"
    if resets_each(request.spec):
        return why_seed_too_large(request.config.seed, request.num_envs)
    if isinstance(request.config.seed, tuple):
        return "it has one generator for all sub-environments, so it needs a single seed"
    return None


def _is_the_same_task(request: _Request) -> bool:
    """Return whether an environment's own implementation is known to play like the single one."""
    return module_of(request.spec).startswith(_SAME_TASK) and not _why_no_entry_point(request)


def _try_entry_point(request: _Request) -> VectorEnv | None:
    try:
        return _make_entry_point(request)
    except _NotPossibleError:
        return None


def _require_entry_point(request: _Request) -> VectorEnv:
    reason = _why_no_entry_point(request)
    _check_sizes(request)
    try:
        if reason is None:
            return _make_entry_point(request)
    except _NotPossibleError as refusal:
        reason = str(refusal)
    raise GymServerError(
        "not_supported",
        f"vectorization_mode 'vector_entry_point' is not possible: {reason}",
        "use vectorization_mode 'sync', or leave vectorization_mode out",
    )


class _NotPossibleError(Exception):
    """An environment's own implementation does not support what the client chose."""


def _make_entry_point(request: _Request) -> VectorEnv:
    creator = make.load_creator(make.vector_spec(request.spec))
    try:
        ours: dict[str, Any] = {"num_envs": request.num_envs}
        if extra_of(request.spec) != "jax":
            mode = make.choose_render_mode(creator, request.spec, request.config.render_mode)
            ours.update({} if mode is None else {"render_mode": mode})
        # Without such an argument its mode may be another one.
        if "autoreset_mode" in parameters_of(creator):
            ours["autoreset_mode"] = request.autoreset_mode
        kwargs = with_tuples(creator, request.kwargs)
        env = make.make_vector_entry_point(request.spec, kwargs, ours)
    except GymServerError as refusal:
        if refusal.code in ("invalid_parameter", "invalid_kwargs"):
            raise _NotPossibleError(refusal.message) from refusal
        if "Invalid autoreset_mode" in refusal.message:
            wanted = request.autoreset_mode.value
            raise _NotPossibleError(f"its autoreset_mode cannot be {wanted}") from refusal
        raise
    if env.num_envs != request.num_envs:
        made = env.num_envs
        env.close()
        raise _NotPossibleError(f"it makes {made} sub-environments, not {request.num_envs}")
    mode = env.metadata.get("autoreset_mode")
    if mode != request.autoreset_mode:
        env.close()
        raise _NotPossibleError(f"its autoreset_mode is {getattr(mode, 'value', mode)}")
    env.spec = _with_time_limit(
        request.spec, request.kwargs.get("max_episode_steps", request.spec.max_episode_steps)
    )
    return env


def _with_time_limit(spec: EnvSpec, max_episode_steps: int | None) -> EnvSpec:
    spec = copy.copy(spec)
    spec.max_episode_steps = max_episode_steps
    return spec


def _check_sizes(request: _Request) -> None:
    """Refuse arguments with which Atari's implementation waits for ever."""
    if not resets_each(request.spec):
        return
    for name in ("img_width", "img_height", "stack_num"):
        if request.kwargs.get(name) == 0:
            raise GymServerError("invalid_kwargs", f"'{name}' must be at least 1, not 0")
    if request.kwargs.get("batch_size", 0) not in (0, request.num_envs):
        raise GymServerError(
            "invalid_kwargs", "'batch_size' must be left out: all sub-environments step together"
        )


# Sub-environments that are environments of their own ------------------------------------------


def _make_sub_envs(request: _Request) -> tuple[SubEnvs, str]:
    render_mode = make.choose_render_mode(
        make.load_creator(request.spec), request.spec, request.config.render_mode
    )
    sub_env = SubEnv(
        request.spec,
        render_mode,
        request.kwargs,
        request.config.wrappers,
        request.renderer,
    )
    num_workers = choose_num_workers(request.config, request.spec)
    try:
        env = make.call_env(_make_with, request, sub_env, num_workers)
    except GymServerError as refusal:
        if request.config.wants_workers or num_workers == 0 or refusal.code != "not_supported":
            raise
        log.info("%s runs in the server's process: %s", request.spec.id, refusal.message)
        env = make.call_env(_make_with, request, sub_env, 0)
    env.spec = _with_time_limit(request.spec, env.time_limit)
    return env, "async" if env.num_workers else "sync"


def _make_with(request: _Request, sub_env: SubEnv, num_workers: int) -> SubEnvs:
    return SubEnvs(
        sub_env,
        request.num_envs,
        request.autoreset_mode,
        num_workers,
        request.renderer,
        # Environments of other packages may leave anything in their processes.
        keeps_processes=is_known(module_of(request.spec)),
    )
