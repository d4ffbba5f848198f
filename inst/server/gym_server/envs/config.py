"""What a client chose when it created an environment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from gymnasium.vector import AutoresetMode


class Wrapper(NamedTuple):
    """A wrapper that a client chose."""

    name: str
    kwargs: dict


@dataclass(frozen=True)
class EnvConfig:
    """What a client chose at creation.

    Attributes:
        env_id: ``Name-v0``, or ``module:Name-v0`` for a module that registers it.
        seed: the seed of the first reset, unless that has its own; for a vector environment also a
            tuple with one per sub-environment.
        render_mode: "rgb_array", "human" (made as "rgb_array": the server opens no window), or None
            for "rgb_array" if the environment supports it.
        kwargs: arguments of the environment.
        wrappers: the wrappers; the first one is innermost.
        num_envs: the number of sub-environments; None for a single environment.
        vectorization_mode: what runs the sub-environments; None for the fastest that works.
        num_workers: the number of worker processes; None to choose.
        max_workers: the largest number that may be chosen.
        autoreset_mode: when to reset a sub-environment whose episode ended; None for NEXT_STEP.
        name: the client's name for the environment.
    """

    env_id: object
    seed: int | tuple[int | None, ...] | None = None
    render_mode: str | None = None
    kwargs: dict | None = None
    wrappers: tuple[Wrapper, ...] = ()
    num_envs: int | None = None
    vectorization_mode: str | None = None
    num_workers: int | None = None
    max_workers: int = 0
    autoreset_mode: AutoresetMode | None = None
    name: str | None = None

    def __str__(self) -> str:
        """Return the environment's id, with its name if it has one."""
        return f"{self.env_id}" if self.name is None else f"{self.env_id} (name {self.name!r})"

    @property
    def wants_workers(self) -> bool:
        """Whether the client asked for worker processes."""
        return bool(self.num_workers) or self.vectorization_mode == "async"
