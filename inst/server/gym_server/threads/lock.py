"""An instance's lock: one thread at a time resets, steps or looks at the environment."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from gym_server.errors import GymServerError
from gym_server.threads.in_progress import InProgress


class InstanceLock:
    """A lock that can be taken from a stuck thread; a context manager for resets and steps.

    Attributes:
        closed: whether the environment is closed.
        why: why the server closed it; None while it is open, or if its owner closed it.
        used: when the environment was last reset or stepped, in the clock's seconds.
        watched: when somebody was last seen watching it, in the clock's seconds.
    """

    def __init__(
        self,
        unknown: Callable[[], GymServerError],
        close_abandoned: Callable[[], None],
        drawing_since: Callable[[int], float | None] = lambda thread: None,
    ) -> None:
        """Create a lock that no thread holds.

        Args:
            unknown: returns the error for an environment that its owner closed.
            close_abandoned: closes the environment; called by a thread that returns after the
                lock was taken from it.
            drawing_since: returns when the render thread started the job that a thread waits for;
                see ``RenderThread.began()``.
        """
        self._unknown = unknown
        self._close_abandoned = close_abandoned
        self._drawing_since = drawing_since
        self._lock = threading.Lock()
        # The thread that holds the lock, and since when. Whoever ends this work, the thread itself
        # or the watchdog, releases the lock.
        self._held: InProgress[int, float] = InProgress()
        self._abandoned: int | None = None
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
        self._held[threading.get_ident()] = now
        if self.closed:
            self._refuse()

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        self.used = time.monotonic()
        if self._held.finish(threading.get_ident()):
            self._lock.release()
        else:
            self._come_back(error)

    def acquire(self, timeout: float) -> bool:
        """Take the lock only to look, which does not count as use of the environment.

        Args:
            timeout: how long to wait, in seconds.

        Returns:
            Whether the caller now holds the lock and must ``release()`` it.

        Raises:
            GymServerError: the environment was closed meanwhile; see ``refusal()``.
        """
        acquired = self._lock.acquire(timeout=timeout)
        if acquired:
            self._held[threading.get_ident()] = time.monotonic()
            if self.closed:
                self._refuse()
        return acquired

    def release(self) -> None:
        """Release the lock after ``acquire()``."""
        if self._held.finish(threading.get_ident()):
            self._lock.release()
        else:
            self._come_back(None)

    @property
    def busy_since(self) -> float | None:
        """When the thread that holds the lock started to work, in the clock's seconds, or None.

        While that thread waits for the render thread, its work has not started.
        """
        for thread, since in list(self._held.items()):
            began = self._drawing_since(thread)
            return since if began is None else began
        return None

    def abandon(self, why: GymServerError) -> int | None:
        """Close the environment, and take the lock from the thread that holds it.

        Args:
            why: the error for every thread that waits for the lock, now or later.

        Returns:
            The thread that held the lock, which gets the error when it returns; None if no thread
            held it.
        """
        self.why, self.closed = why, True
        for thread in list(self._held):
            if self._held.abandon(thread):
                self._abandoned = thread
                self._lock.release()
                return thread
        return None

    def answered(self) -> None:
        """Let the thread that lost the lock continue: its client was answered."""
        if self._abandoned is not None:
            self._held.answered(self._abandoned)

    def refusal(self) -> GymServerError:
        """Return the error for calls on a closed environment."""
        return self.why.again() if self.why else self._unknown()

    def when_free(self) -> threading.Lock:
        """Return the bare lock, for work after the environment is closed."""
        return self._lock

    def _come_back(self, error: object) -> None:
        """End the work of a thread from which the lock was taken."""
        # Close the environment, unless this thread only waited for the render thread. In that case
        # the error is the reason passed to RenderThread.abandon(), and the render thread is still
        # in the environment, so nothing else may touch it.
        if error is not self.why:
            self._close_abandoned()
        self._held.wait_until_answered(threading.get_ident())
        raise self.refusal()

    def _refuse(self) -> None:
        if self._held.finish(threading.get_ident()):
            self._lock.release()
        raise self.refusal()
