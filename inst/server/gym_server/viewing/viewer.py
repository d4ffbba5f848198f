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
from typing import NamedTuple

from gym_server.errors import GymServerError
from gym_server.protocol.answers import dumps
from gym_server.rendering.png import png
from gym_server.viewing.capture import Busy, capture
from gym_server.viewing.watchable import Watchable

# The shortest time between two frames of an environment, however many watch it.
_LEAST_SECONDS = 1 / 30

# The largest share of the time in which drawing may block an environment's steps.
_SHARE = 0.2
# The same for steps that wait for real time anyway.
_PACED_SHARE = 0.5

# A watcher gets a response after this long even if nothing has happened; proxies wait longer.
_LONGEST_WAIT = 15.0

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
                    frame = self._look(sub_env, after, deadline)
                if frame is not None:
                    return frame.body
                self._ending.wait(_LEAST_SECONDS)
        except Busy:
            self.note_presence()
            return dumps({"number": after, "state": "busy"})

    def _look(self, sub_env: int, after: int | None, deadline: float) -> _Frame | None:
        """Return the frame for a watcher; None if there is nothing new yet."""
        last = self._last if self._last is not None and self._last.sub_env == sub_env else None
        number, now = self._watchable.resets_and_steps, time.monotonic()
        is_stale = last.number != number if last is not None else after != number
        if is_stale and now >= self._due:
            return self._draw(sub_env, deadline)
        if last is not None and (last.number != after or now >= deadline):
            return last
        if now < deadline:
            return None
        if now < self._due:
            # No frame was ever drawn.
            raise Busy
        return self._draw(sub_env, deadline)

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

    def _draw(self, sub_env: int, deadline: float) -> _Frame:
        captured = capture(self._watchable, sub_env, deadline, self._may_wait_until)
        facts, frame = captured.facts, captured.frame
        # Encode without the lock, so that the environment can continue.
        facts["frame"] = None if frame is None else base64.b64encode(png(frame)).decode("ascii")
        share = _PACED_SHARE if self._next_tick > captured.began - 1 else _SHARE
        # The first frame takes longer, because the environment loads fonts and colours.
        wait = captured.seconds / share if self._last is not None else 0.0
        self._due = captured.began + max(_LEAST_SECONDS, wait)
        number = captured.resets_and_steps
        self._last = _Frame(sub_env, number, dumps({"number": number, **facts}))
        return self._last

    def _may_wait_until(self, deadline: float) -> bool:
        return self._ended is None and time.monotonic() < deadline

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
