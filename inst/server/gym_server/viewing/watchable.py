"""What an instance must have to be watched."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from gym_server.rendering.render_thread import RenderThread

if TYPE_CHECKING:
    import numpy as np


class Moves:
    """Counts how often an environment has begun to move.

    Attributes:
        count: how often.
        on_next: called once when the environment moves the next time; None for nothing.
    """

    __slots__ = ("count", "on_next")

    def __init__(self) -> None:
        """Start at 0."""
        self.count = 0
        self.on_next: Callable[[], None] | None = None

    def begin(self) -> None:
        """Count a move that begins."""
        self.count += 1
        if self.on_next is not None:
            call, self.on_next = self.on_next, None
            call()


class Lock(Protocol):
    """What keeps an environment from moving while it is looked at."""

    def acquire(self, timeout: float) -> bool:
        """Wait for it so many seconds; return whether the caller has it now."""

    def release(self) -> None:
        """Let the environment move again."""


class Watchable(Protocol):
    """An environment that can be watched."""

    @property
    def lock(self) -> Lock:
        """What a thread needs to look at it."""

    @property
    def moves(self) -> Moves:
        """How often it has moved."""

    @property
    def renderer(self) -> RenderThread:
        """The process's render thread."""

    @property
    def draws_on_render_thread(self) -> bool:
        """Whether a frame of it is drawn on the render thread."""

    @property
    def draws_when_stepped(self) -> bool:
        """Whether its steps run on the render thread."""

    def look(self, sub_env: int) -> tuple[dict, np.ndarray | None]:
        """Return what a watcher sees of a sub-environment; the caller has the lock.

        Returns:
            JSON values, among them the observation where there is no frame and the reason why
            there is none; the frame or None.
        """
