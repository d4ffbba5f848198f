"""An instance's lock: one thread at a time resets, steps or looks at the environment."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from threading import get_ident

from gym_server.errors import GymServerError
from gym_server.threads import calls


class InstanceLock:
    """A lock that refuses calls on a closed environment; a context manager for resets and steps.

    Attributes:
        closed: whether the environment is closed.
        why: why the server closed it; None while it is open, or if its owner closed it.
        call: what the thread that holds it does, as the name of a method.
        used: when the environment was last reset or stepped, in the clock's seconds.
        watched: when somebody was last seen watching it, in the clock's seconds.
    """

    def __init__(
        self, unknown: Callable[[], GymServerError], describe: Callable[[str], str]
    ) -> None:
        """Create a lock that no thread holds.

        Args:
            unknown: returns the error for an environment that its owner closed.
            describe: describes a call on the environment, for the log.
        """
        self._unknown = unknown
        self.call = ""
        self._describe = lambda: describe(self.call)
        self._lock = threading.Lock()
        self.closed = False
        self.why: GymServerError | None = None
        self.used = time.monotonic()
        self.watched = 0.0

    def __enter__(self) -> None:
        """Wait for the lock, to reset or step the environment.

        Raises:
            GymServerError: the environment was closed meanwhile; see ``refusal()``.
        """
        self._lock.acquire()
        self.used = now = time.monotonic()
        calls.running[get_ident()] = now, self._describe
        if self.closed:
            self._refuse()

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        self.used = time.monotonic()
        self.release()

    def acquire(self, timeout: float) -> bool:
        """Take the lock only to draw, which does not count as use of the environment.

        Args:
            timeout: how long to wait, in seconds.

        Returns:
            Whether the caller now holds the lock and must ``release()`` it.

        Raises:
            GymServerError: the environment was closed meanwhile; see ``refusal()``.
        """
        acquired = self._lock.acquire(timeout=timeout)
        if acquired:
            self.call = "render"
            calls.running[get_ident()] = time.monotonic(), self._describe
            if self.closed:
                self._refuse()
        return acquired

    def release(self) -> None:
        """Release the lock after ``acquire()``."""
        calls.running.pop(get_ident(), None)
        self._lock.release()

    @property
    def is_held(self) -> bool:
        """Whether a thread holds the lock."""
        return self._lock.locked()

    def refusal(self) -> GymServerError:
        """Return the error for calls on a closed environment."""
        return self.why.again() if self.why else self._unknown()

    def _refuse(self) -> None:
        self.release()
        raise self.refusal()
