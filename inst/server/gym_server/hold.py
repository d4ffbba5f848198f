"""The right to move an environment, or to look at it while it stands still."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

from gym_server.errors import unknown_instance

if TYPE_CHECKING:
    from gym_server.instance import Instance


class Hold:
    """What one thread at a time has; a context for those that move the environment.

    Attributes:
        closed: whether the environment is gone.
        used: when it was last moved, in the clock's seconds.
    """

    def __init__(self, instance: Instance) -> None:
        """Belong to nobody yet."""
        self._instance = instance
        self._lock = threading.Lock()
        self.closed = False
        self.used = time.monotonic()

    def __enter__(self) -> None:
        """Wait for it.

        Raises:
            GymServerError: ``unknown_instance`` when the environment was closed meanwhile.
        """
        self._lock.acquire()
        self._refuse_closed()
        self.used = time.monotonic()

    def __exit__(self, *_: object) -> None:
        self.used = time.monotonic()
        self._lock.release()

    def take(self, seconds: float) -> bool:
        """Have it to look only, which is no use of the environment.

        Args:
            seconds: how long to wait for it.

        Returns:
            Whether the caller has it now, and must ``give_back()``.

        Raises:
            GymServerError: ``unknown_instance``.
        """
        taken = self._lock.acquire(timeout=seconds)
        if taken:
            self._refuse_closed()
        return taken

    def give_back(self) -> None:
        """End the look."""
        self._lock.release()

    def _refuse_closed(self) -> None:
        if self.closed:
            self._lock.release()
            raise unknown_instance(self._instance.instance_id)
