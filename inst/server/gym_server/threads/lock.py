"""The lock of an instance: one thread at a time resets or steps the environment, or looks at it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from gym_server.errors import GymServerError
from gym_server.threads.in_progress import InProgress


class InstanceLock:
    """A lock that can be taken away from a thread that is stuck; a context for resets and steps.

    Attributes:
        closed: whether the environment is gone.
        why: why the server closed it; None while it is open, or where its owner closed it.
        used: when the environment was last reset or stepped, in the clock's seconds.
        watched: when somebody was last found to watch it, in the clock's seconds.
    """

    def __init__(
        self,
        unknown: Callable[[], GymServerError],
        close_abandoned: Callable[[], None],
        drawing_since: Callable[[int], float | None] = lambda thread: None,
    ) -> None:
        """Make a lock that no thread has.

        Args:
            unknown: returns the error for an environment that its owner closed.
            close_abandoned: closes the environment; called in a thread that comes back after the
                lock was taken away from it.
            drawing_since: returns since when the job has been running that a thread waits for the
                render thread to do; see ``RenderThread.began()``.
        """
        self._unknown = unknown
        self._close_abandoned = close_abandoned
        self._drawing_since = drawing_since
        self._lock = threading.Lock()
        # The thread that has the lock, and since when. The thread that ends this work, its own or
        # the watchdog's, releases the lock.
        self._held: InProgress[int, float] = InProgress()
        self._abandoned: int | None = None
        self.closed = False
        self.why: GymServerError | None = None
        self.used = time.monotonic()
        self.watched = 0.0

    def __enter__(self) -> None:
        """Wait for the lock, to reset or step the environment.

        Raises:
            GymServerError: when the environment was closed meanwhile, see ``refusal()``.
        """
        self._lock.acquire()
        self.used = now = time.monotonic()
        self._held.begin(threading.get_ident(), now)
        if self.closed:
            self._refuse()

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        self.used = time.monotonic()
        if self._held.finish(threading.get_ident()):
            self._lock.release()
        else:
            self._come_back(error)

    def acquire(self, timeout: float) -> bool:
        """Take the lock only to look, which does not count as using the environment.

        Args:
            timeout: how long to wait for it, in seconds.

        Returns:
            Whether the caller has the lock now, and must ``release()`` it.

        Raises:
            GymServerError: when the environment was closed meanwhile, see ``refusal()``.
        """
        acquired = self._lock.acquire(timeout=timeout)
        if acquired:
            self._held.begin(threading.get_ident(), time.monotonic())
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
        """Since when the thread with the lock has been working, in the clock's seconds, or None.

        The work of a thread that waits for the render thread has not begun.
        """
        for thread, since in self._held.items():
            began = self._drawing_since(thread)
            return since if began is None else began
        return None

    def abandon(self, why: GymServerError) -> int | None:
        """Close the environment, and take the lock away from the thread that has it.

        Args:
            why: the error for every thread that waits for the lock, or will.

        Returns:
            The thread that had the lock, which gets the error when it comes back; None when no
            thread had it.
        """
        self.why, self.closed = why, True
        for thread, _ in self._held.items():
            if self._held.abandon(thread):
                self._abandoned = thread
                self._lock.release()
                return thread
        return None

    def answered(self) -> None:
        """Let the thread go on from which the lock was taken, as it was answered for."""
        if self._abandoned is not None:
            self._held.answered(self._abandoned)

    def refusal(self) -> GymServerError:
        """Return the error for calls on an environment that is gone."""
        return self.why.again() if self.why else self._unknown()

    def when_free(self) -> threading.Lock:
        """Return the bare lock, for what is done after the end."""
        return self._lock

    def _come_back(self, error: object) -> None:
        """End a thread's work from which the lock was taken away meanwhile."""
        # The environment has to be closed, unless this thread only waited for the render thread.
        # Then the error is the reason for abandoning it, which RenderThread.abandon() passes on,
        # and the render thread is still in the environment, so nothing else may touch it.
        if error is not self.why:
            self._close_abandoned()
        self._held.wait_until_answered(threading.get_ident())
        raise self.refusal()

    def _refuse(self) -> None:
        if self._held.finish(threading.get_ident()):
            self._lock.release()
        raise self.refusal()
