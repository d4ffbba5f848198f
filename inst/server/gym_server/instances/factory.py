"""Make an environment and what keeps it, here in this process."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection

from gym_server.envs import make, vectorization, wrappers
from gym_server.envs.config import EnvConfig
from gym_server.envs.memory_reservation import MemoryReservation
from gym_server.errors import GymServerError
from gym_server.instances.instance import Instance
from gym_server.instances.vector_instance import VectorInstance
from gym_server.rendering.render_thread import RenderThread


def make_instance(
    choices: EnvConfig,
    allowed_modules: Collection[str],
    max_num_envs: int,
    renderer: RenderThread,
    undo: contextlib.ExitStack,
    account: MemoryReservation,
) -> Instance:
    """Make an instance of what a client wants.

    Args:
        choices: what that is.
        allowed_modules: names of the modules that an env_id may import.
        max_num_envs: how many sub-environments it may have.
        renderer: the process's render thread.
        undo: closes the environment when something goes wrong from here on.
        account: what its memory is charged to.

    Raises:
        GymServerError: see ``make_env()``, ``make_vector_env()``, ``wrappers.wrap()``
            and ``Instance``.
    """
    if choices.num_envs is None:
        env = make.make_env(
            choices.env_id,
            choices.render_mode,
            choices.kwargs or {},
            allowed_modules,
            choices.wrappers,
            account,
        )
        undo.push(_closing_quietly(renderer, env.close))
        wrapped = make.ask(wrappers.wrap, env, choices.wrappers, renderer, account)
        return Instance(wrapped, choices, renderer)
    sub_envs, mode = vectorization.make_vector_env(
        choices, allowed_modules, max_num_envs, renderer, account
    )
    undo.push(_closing_quietly(renderer, sub_envs.close))
    return VectorInstance(sub_envs, mode, choices, renderer)


def _closing_quietly(renderer: RenderThread, close: Callable[[], None]) -> Callable[..., None]:
    def leave(kind: type | None, error: BaseException | None, *_: object) -> None:
        # The render thread hangs in it, and must be left to that.
        if isinstance(error, GymServerError) and error.code == "call_too_long":
            return
        # What the client must hear of is why it gets no instance.
        with contextlib.suppress(BaseException):
            renderer.run(close)

    return leave
