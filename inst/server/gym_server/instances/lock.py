"""The right to move an environment, or to look at it while it stands still."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

from gym_server.errors import GymServerError, unknown_instance

if TYPE_CHECKING:
    from gym_server.instances.instance import Instance
    from gym_server.rendering.render_thread import RenderThread


# Longer than it takes to send a short answer to somebody who does not read.
SETTLED_SECONDS = 5.0


class Hold:
    """What one thread at a time has; a context for those that move the environment.

    Attributes:
        closed: whether the environment is gone.
        why: the reason, for those who still ask for it; None where its owner closed it.
        used: when it was last moved, in the clock's seconds.
        watched: when somebody was last found to watch it, in the clock's seconds.
    """

    def __init__(self, instance: Instance, renderer: RenderThread | None = None) -> None:
        """Belong to nobody yet.

        Args:
            instance: what it is the right to.
            renderer: where those who have it may have to wait for their turn.
        """
        self._instance = instance
        self._renderer = renderer
        self._lock = threading.Lock()
        # Who has it, since when. Whoever takes the entry out, which only one thread can, is the
        # one to release the lock.
        self._held: dict[int, float] = {}
        self.closed = False
        self.why: GymServerError | None = None
        self.used = time.monotonic()
        self.watched = 0.0
        self._settled = threading.Event()

    def __enter__(self) -> None:
        """Wait for it.

        Raises:
            GymServerError: when the environment was closed meanwhile, ``gone()``.
        """
        self._lock.acquire()
        self.used = now = time.monotonic()
        self._held[threading.get_ident()] = now
        if self.closed:
            self._refuse()

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        self.used = time.monotonic()
        self._let_go(error)

    def take(self, seconds: float) -> bool:
        """Have it to look only, which is no use of the environment.

        Args:
            seconds: how long to wait for it.

        Returns:
            Whether the caller has it now, and must ``give_back()``.

        Raises:
            GymServerError: as to move it.
        """
        taken = self._lock.acquire(timeout=seconds)
        if taken:
            self._held[threading.get_ident()] = time.monotonic()
            if self.closed:
                self._refuse()
        return taken

    def give_back(self) -> None:
        """End the look."""
        self._let_go(None)

    @property
    def busy_since(self) -> float | None:
        """Since when somebody has it and does something with it, or None.

        Whoever waits for the render thread has not begun.
        """
        for thread, since in tuple(self._held.items()):
            began = self._renderer.began(thread) if self._renderer else None
            return since if began is None else began
        return None

    def condemn(self, why: GymServerError) -> int | None:
        """Take it away from whoever has it, for good.

        Args:
            why: what everybody hears who wants it from now on, or waits for it.

        Returns:
            The thread that had it, which will hear of it when it comes back; None when nobody
            had it.
        """
        self.why, self.closed = why, True
        for thread in tuple(self._held):
            if self._held.pop(thread, None) is not None:
                self._lock.release()
                return thread
        return None

    def gone(self) -> GymServerError:
        """Return what to tell whoever asks for an environment that is gone."""
        return self.why.again() if self.why else unknown_instance(self._instance.instance_id)

    def settle(self) -> None:
        """Say that what was condemned was answered for: its thread may go on to other things."""
        self._settled.set()

    def when_free(self) -> threading.Lock:
        """Return the bare lock, for what happens after the end."""
        return self._lock

    def _let_go(self, error: object) -> None:
        if self._held.pop(threading.get_ident(), None) is not None:
            self._lock.release()
            return
        # Condemned meanwhile. When it is the render thread that hangs in the environment, it
        # must be left to that.
        if error is not self.why:
            self._instance.clear_away()
        # Else the answer that is given on its behalf might go to its next request.
        self._settled.wait(SETTLED_SECONDS)
        raise self.gone()

    def _refuse(self) -> None:
        if self._held.pop(threading.get_ident(), None) is not None:
            self._lock.release()
        raise self.gone()
