"""Create instances whose environment runs in this process."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection
from functools import partial

from gym_server import logs
from gym_server.envs import make, wrappers
from gym_server.envs.config import EnvConfig
from gym_server.instances.instance import Instance
from gym_server.instances.single import SingleInstance
from gym_server.instances.vector import VectorInstance
from gym_server.rendering.render_thread import RenderThread
from gym_server.vector_envs.make_vec import make_vector_env


def make_instance(
    config: EnvConfig,
    allowed_modules: Collection[str],
    max_num_envs: int,
    renderer: RenderThread,
    undo: contextlib.ExitStack,
) -> Instance:
    """Create an instance whose environment runs in this process.

    Args:
        config: what the client chose.
        allowed_modules: the modules that an env_id may import.
        max_num_envs: the largest number of sub-environments.
        renderer: the process's render thread.
        undo: closes the environment if a later step fails.

    Raises:
        GymServerError: see ``make_env()``, ``make_vector_env()``, ``wrappers.wrap()``
            and ``Instance``.
    """
    with logs.hearing() as warnings:
        if config.num_envs is None:
            env = make.make_env(config, allowed_modules)
            undo.callback(_quietly, partial(renderer.close, env.close, drawn=False))
            wrapped = make.call_env(wrappers.wrap, env, config.wrappers, renderer)
            instance: Instance = SingleInstance(wrapped, config, renderer)
        else:
            sub_envs, mode = make_vector_env(config, allowed_modules, max_num_envs, renderer)
            undo.callback(_quietly, sub_envs.close)
            instance = VectorInstance(sub_envs, mode, config, renderer)
    instance.warnings = warnings
    return instance


def _quietly(close: Callable[[], object]) -> None:
    # The client gets the original error, not one from closing.
    with contextlib.suppress(BaseException):
        close()
