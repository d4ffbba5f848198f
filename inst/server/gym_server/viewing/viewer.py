"""Show an environment to its watchers; it is drawn only while a watcher waits for a frame.

A watcher requests a newer frame than the one it has (a long poll). The thread of that request looks
whether there was a reset or step, and draws the environment for all watchers. So drawing stops when
nobody asks any more, a slow watcher delays only itself, and the thread that steps the environment
only counts its resets and steps.
"""

from __future__ import annotations

import base64
import threading
import time
from typing import TYPE_CHECKING, NamedTuple, Protocol

from gym_server.errors import GymServerError
from gym_server.protocol.answers import dumps
from gym_server.rendering.png import png
from gym_server.threads.lock import InstanceLock

if TYPE_CHECKING:
    import numpy as np

# The shortest time between two frames of an environment, however many watch it.
_LEAST_SECONDS = 1 / 30

# The largest share of the time in which drawing may block an environment's steps.
_SHARE = 0.2
# The same for steps that wait for real time anyway.
_PACED_SHARE = 0.5

# A watcher gets a response after this long even if nothing has happened; proxies wait longer.
_LONGEST_WAIT = 15.0

# A watcher that waits longer than this for a step gets the answer "busy".
_LOCK_TIMEOUT = 2.0

# How long after its last request a watcher counts as watching.
_STAYS_SECONDS = 2.0

# The pace of environments without a render_fps, and the longest wait of a step.
_USUAL_FPS = 30.0
_LONGEST_PACE = 1.0


def usable_fps(fps: object) -> float:
    """Return how many steps a second to show, given an environment's render_fps."""
    if isinstance(fps, (int, float)) and 1 / _LONGEST_PACE <= fps <= 10_000:
        return float(fps)
    return _USUAL_FPS


class Watchable(Protocol):
    """An environment that can be watched.

    Attributes:
        lock: the lock for playing the environment or looking at it.
        resets_and_steps: how many resets and steps have started.
    """

    lock: InstanceLock
    resets_and_steps: int

    def look(self, sub_env: int) -> tuple[dict, np.ndarray | None]:
        """Return what a watcher sees of a sub-environment; the caller holds the lock.

        Returns:
            JSON values, and the frame or None. Without a frame the values include the observation
            and the reason.
        """


class _Busy(Exception):  # noqa: N818
    """A step takes too long to draw anything."""


class _Frame(NamedTuple):
    """What watchers see of a sub-environment at one moment; the response for them is JSON."""

    sub_env: int
    number: int
    body: bytes


class Viewer:
    """Shows one environment to its watchers, and limits its pace if that is wanted.

    Attributes:
        fps: how many steps a second to show; see ``usable_fps()``.
    """

    def __init__(self, watchable: Watchable) -> None:
        """Start without frames."""
        self._watchable = watchable
        self.fps = _USUAL_FPS
        # Held while drawing, for all who wait.
        self._drawing = threading.Lock()
        self._last: _Frame | None = None
        self._due = 0.0
        self._stays_until = 0.0
        self._ended: GymServerError | None = None
        self._ending = threading.Event()
        self._next_tick = 0.0

    # For watchers ---------------------------------------------------------------------------

    def next_frame(self, sub_env: int, after: int | None) -> bytes:
        """Wait for a frame that a watcher has not seen.

        Args:
            sub_env: the sub-environment to look at.
            after: the number of the last frame that the watcher saw.

        Returns:
            The frame as JSON: the values of ``Watchable.look()``, a "number", and a "frame", a PNG
            in Base64. If nothing happens for long, the frame that the watcher has seen. If the
            environment cannot be drawn for long, only the "state".

        Raises:
            GymServerError: ``unknown_instance`` if the environment is closed meanwhile,
                ``shutting_down``.
        """
        deadline = time.monotonic() + _LONGEST_WAIT
        try:
            while True:
                self.note_presence()
                with self._drawing:
                    frame = self._newer(sub_env, after, deadline)
                if frame is not None:
                    return frame.body
                self._ending.wait(_LEAST_SECONDS)
        except _Busy:
            self.note_presence()
            return dumps({"number": after, "state": "busy"})

    def _newer(self, sub_env: int, after: int | None, deadline: float) -> _Frame | None:
        """Return the frame for a watcher; None if there is nothing new yet."""
        last = self._last if self._last is not None and self._last.sub_env == sub_env else None
        number, now = self._watchable.resets_and_steps, time.monotonic()
        is_stale = last.number != number if last is not None else after != number
        if is_stale and now >= self._due:
            return self._draw(sub_env)
        if last is not None and (last.number != after or now >= deadline):
            return last
        if now < deadline:
            return None
        if now < self._due:
            # No frame was ever drawn.
            raise _Busy
        return self._draw(sub_env)

    def note_presence(self) -> None:
        """Count a watcher as watching for a while, without sending a frame."""
        if self._ended is not None:
            raise self._ended.again()
        self._stays_until = time.monotonic() + _STAYS_SECONDS

    @property
    def is_watched(self) -> bool:
        """Whether somebody is watching."""
        return time.monotonic() < self._stays_until

    # Drawing --------------------------------------------------------------------------------

    def _draw(self, sub_env: int) -> _Frame:
        lock = self._watchable.lock
        deadline = time.monotonic() + _LOCK_TIMEOUT
        # Wait briefly each time, so that a step that hangs does not delay the end of the server.
        while not lock.acquire(0.1):
            if self._ended is not None or time.monotonic() > deadline:
                raise _Busy
        began = time.monotonic()
        try:
            number = self._watchable.resets_and_steps
            facts, frame = self._watchable.look(sub_env)
        finally:
            lock.release()
        share = _PACED_SHARE if self._next_tick > began - 1 else _SHARE
        # The first frame takes longer, because the environment loads fonts and colours.
        wait = (time.monotonic() - began) / share if self._last is not None else 0.0
        self._due = began + max(_LEAST_SECONDS, wait)
        # Encode without the lock, so that the environment can continue.
        facts["frame"] = None if frame is None else base64.b64encode(png(frame)).decode("ascii")
        self._last = _Frame(sub_env, number, dumps({"number": number, **facts}))
        return self._last

    # For the instance -----------------------------------------------------------------------

    def pace(self) -> None:
        """Sleep until the environment's next step is due, if somebody watches."""
        if self.is_watched:
            now = time.monotonic()
            tick = max(now, self._next_tick)
            self._next_tick = tick + 1 / self.fps
            self._ending.wait(tick - now)

    def end(self, why: GymServerError) -> None:
        """Answer every watcher with an error from now on."""
        self._ended = why
        self._ending.set()
