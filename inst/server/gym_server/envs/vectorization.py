"""Make a vector environment by the mode that was chosen, or by the fastest that fits."""

from __future__ import annotations

import copy
from collections.abc import Collection
from dataclasses import dataclass

from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, VectorEnv

from gym_server.envs import make, repeats
from gym_server.envs.config import Choices
from gym_server.envs.footprint import Account, answer_bytes, environment_bytes, vector_bytes
from gym_server.envs.vector_envs import AsyncSubEnvs, SubEnv, SyncSubEnvs
from gym_server.errors import GymServerError, wrong_length
from gym_server.json_values import from_words
from gym_server.rendering.render_thread import RenderThread

# Each is a process.
MOST_PROCESSES = 64


def make_vector_env(
    choices: Choices,
    allowed_modules: Collection[str],
    most: int,
    renderer: RenderThread,
    account: Account,
) -> tuple[VectorEnv, str]:
    """Make a vector environment.

    Args:
        choices: what the client wants; its wrappers are on the list.
        allowed_modules: as for ``make.make_env()``.
        most: how many sub-environments the server allows.
        renderer: the process's render thread.
        account: what its memory is charged to.

    Returns:
        It, and its vectorization_mode.

    Raises:
        GymServerError: as for ``make.make_env()``; ``too_many_sub_envs``, ``too_much_memory``,
            ``not_supported``.
    """
    kwargs = choices.kwargs or {}
    make.check_kwargs(kwargs)
    spec = make.find_spec(choices.env_id, allowed_modules)
    _check(choices, most)
    repeats.check(spec, kwargs, choices.wrappers, choices.num_envs)
    with make.naming_extra(spec):
        asked = _Asked(spec, choices, from_words(kwargs), renderer, account)
        match choices.vectorization_mode:
            case None:
                env = None if _against_entry_point(asked) else _try_entry_point(asked)
                return (_make_sync(asked), "sync") if env is None else (env, "vector_entry_point")
            case "sync":
                return _make_sync(asked), "sync"
            case "async":
                return _make_async(asked), "async"
            case _:
                return _insist_on_entry_point(asked), "vector_entry_point"


@dataclass(frozen=True)
class _Asked:
    spec: EnvSpec
    choices: Choices
    kwargs: dict
    renderer: RenderThread
    account: Account

    @property
    def num_envs(self) -> int:
        return self.choices.num_envs  # type: ignore[return-value]

    @property
    def autoreset_mode(self) -> AutoresetMode:
        return self.choices.autoreset_mode or AutoresetMode.NEXT_STEP


def check_single(choices: Choices) -> None:
    """Raise ``invalid_parameter`` for what only sub-environments can have."""
    sub_envs_only = {
        "vectorization_mode": choices.vectorization_mode,
        "autoreset_mode": choices.autoreset_mode,
        "seed": choices.seed if isinstance(choices.seed, tuple) else None,
    }
    for name, value in sub_envs_only.items():
        if value is not None:
            what = "A list as 'seed'" if name == "seed" else f"The parameter '{name}'"
            raise GymServerError(
                "invalid_parameter",
                f"{what} is for vector environments, and 'num_envs' was not provided",
                "give num_envs, the number of sub-environments, which may also be 1",
            )


def _check(choices: Choices, most: int) -> None:
    if isinstance(choices.seed, tuple) and len(choices.seed) != choices.num_envs:
        raise wrong_length("seed", len(choices.seed), choices.num_envs, "integer or null")
    if choices.num_envs > most:
        raise GymServerError(
            "too_many_sub_envs",
            f"This server takes at most {most} sub-environments, not {choices.num_envs}",
            "the server's option --max-num-envs sets the limit",
        )
    if choices.vectorization_mode == "async" and choices.num_envs > MOST_PROCESSES:
        raise GymServerError(
            "too_many_sub_envs",
            f"'async' takes at most {MOST_PROCESSES} sub-environments, a process each, not "
            f"{choices.num_envs}",
            "vectorization_mode 'sync' takes as many as the server's option --max-num-envs says",
        )


# An environment's own implementation --------------------------------------------------------


def _against_entry_point(asked: _Asked) -> str | None:
    """Return why the environment's own implementation cannot do it, as far as is known before."""
    if asked.spec.vector_entry_point is None:
        return f"{asked.spec.id} has none"
    if asked.choices.wrappers or asked.spec.additional_wrappers:
        return "it takes no wrappers"
    if asked.kwargs.get("max_episode_steps", 1) in (-1, None):
        return "it has no words for no time limit"
    if isinstance(asked.choices.seed, tuple):
        return "it has one generator for all sub-environments, so it takes one seed"
    return None


def _try_entry_point(asked: _Asked) -> VectorEnv | None:
    try:
        env = _make_entry_point(asked)
        if _is_the_same_task(env, asked):
            return env
        env.close()
    except _CannotDo:
        pass
    asked.account.give_back()
    return None


def _is_the_same_task(env: VectorEnv, asked: _Asked) -> bool:
    """Tell whether sub-environments have the spaces of the environment.

    Atari's own see other pictures. They are also taken for the same when only they can be made.
    """
    try:
        single = make.make_from_spec(asked.spec, None, asked.kwargs)
    except GymServerError:
        return True
    same = (env.single_observation_space, env.single_action_space) == (
        single.observation_space,
        single.action_space,
    )
    asked.renderer.run(single.close)
    return same


def _insist_on_entry_point(asked: _Asked) -> VectorEnv:
    reason = _against_entry_point(asked)
    try:
        if reason is None:
            return _make_entry_point(asked)
    except _CannotDo as refusal:
        reason = str(refusal)
    raise GymServerError(
        "not_supported",
        f"vectorization_mode 'vector_entry_point' is not possible: {reason}",
        "vectorization_mode 'sync' does it, and so does leaving vectorization_mode out",
    )


class _CannotDo(Exception):  # noqa: N818 - where nothing was chosen, it is no error
    """What was asked for is not what an implementation does."""


def _make_entry_point(asked: _Asked) -> VectorEnv:
    asked.account.charge(vector_bytes(asked.spec, asked.kwargs), asked.spec.id)
    wanted = asked.choices.render_mode
    vector_spec = copy.copy(asked.spec)
    vector_spec.entry_point = asked.spec.vector_entry_point
    creator = make.load_creator(vector_spec)
    try:
        render_mode = make.choose_render_mode(creator, asked.spec, wanted)
        env = make.make_vector_entry_point(asked.spec, asked.num_envs, render_mode, asked.kwargs)
    except GymServerError as refusal:
        if refusal.code in ("invalid_parameter", "invalid_kwargs"):
            raise _CannotDo(refusal.message) from refusal
        raise
    mode = env.metadata.get("autoreset_mode")
    if mode != asked.autoreset_mode:
        env.close()
        raise _CannotDo(f"its autoreset_mode is {getattr(mode, 'value', mode)}")
    env.spec = _with_time_limit(asked)
    try:
        asked.account.charge(answer_bytes(env.single_observation_space), "What is observed")
    except GymServerError:
        env.close()
        raise
    return env


def _with_time_limit(asked: _Asked) -> EnvSpec:
    """Return the spec with the smallest of the time limits that each sub-environment has."""
    spec = copy.copy(asked.spec)
    chosen = asked.kwargs.get("max_episode_steps")
    if chosen is not None:
        spec.max_episode_steps = None if chosen == -1 else chosen
    limits = [
        from_words(wrapper.kwargs["max_episode_steps"])
        for wrapper in asked.choices.wrappers
        if wrapper.name == "TimeLimit"
    ]
    spec.max_episode_steps = min(filter(None, [spec.max_episode_steps, *limits]), default=None)
    return spec


# Gymnasium's --------------------------------------------------------------------------------


def _make_sync(asked: _Asked) -> VectorEnv:
    return _make_sub_envs(SyncSubEnvs, asked)


def _make_async(asked: _Asked) -> VectorEnv:
    return _make_sub_envs(AsyncSubEnvs, asked)


def _make_sub_envs(kind: type[SyncSubEnvs] | type[AsyncSubEnvs], asked: _Asked) -> VectorEnv:
    render_mode = make.choose_render_mode(
        make.load_creator(asked.spec), asked.spec, asked.choices.render_mode
    )
    asked.account.charge(environment_bytes(asked.spec, asked.kwargs), asked.spec.id)
    sub_env = SubEnv(
        asked.spec,
        render_mode,
        asked.kwargs,
        asked.choices.wrappers,
        asked.renderer,
        asked.account,
    )
    env = make.ask(kind, sub_env, asked.num_envs, asked.autoreset_mode)
    env.spec = _with_time_limit(asked)
    return env
