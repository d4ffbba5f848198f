"""What a client chose when it created an environment."""

from __future__ import annotations

from dataclasses import dataclass

from gymnasium.vector import AutoresetMode

from gym_server.envs.wrappers import Wrapper


@dataclass(frozen=True)
class Choices:
    """What a client chose at creation.

    Attributes:
        env_id: what to create.
        seed: for the first reset that has none; for a vector environment also one a
            sub-environment.
        render_mode: see ``make.make_env()``.
        kwargs: handed to the environment.
        wrappers: the first one is innermost.
        num_envs: how many sub-environments; None for a single environment.
        vectorization_mode: what runs the sub-environments; None leaves it to us.
        autoreset_mode: what becomes of a sub-environment whose episode ended; None for NEXT_STEP.
        name: what its owner calls it.
    """

    env_id: object
    seed: int | tuple[int | None, ...] | None = None
    render_mode: str | None = None
    kwargs: dict | None = None
    wrappers: tuple[Wrapper, ...] = ()
    num_envs: int | None = None
    vectorization_mode: str | None = None
    autoreset_mode: AutoresetMode | None = None
    name: str | None = None
