"""What an instance must have to be watched."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gym_server.rendering.render_thread import RenderThread
from gym_server.threads.lock import InstanceLock

if TYPE_CHECKING:
    import numpy as np


class Watchable:
    """An environment that can be watched.

    Attributes:
        lock: the lock for playing the environment or looking at it.
        renderer: the process's render thread.
        draws_when_stepped: whether its steps run on the render thread.
        draws_on_render_thread: whether its frames are drawn on the render thread.
        resets_and_steps: how many resets and steps have started.
    """

    lock: InstanceLock
    renderer: RenderThread
    draws_when_stepped: bool
    draws_on_render_thread: bool
    resets_and_steps = 0

    def look(self, sub_env: int) -> tuple[dict, np.ndarray | None]:
        """Return what a watcher sees of a sub-environment; the caller holds the lock.

        Returns:
            JSON values, and the frame or None. Without a frame the values include the observation
            and the reason.
        """
        raise NotImplementedError
