"""Show an environment to its watchers; it is drawn only while a watcher waits for a frame.

A watcher requests a newer frame than the one it has (a long poll), and the thread of that request
draws the environment for all watchers that wait. So drawing stops when nobody asks any more, a slow
watcher delays only itself, and the thread that steps the environment only counts its resets and
steps.
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

# Frames of sub-environments that nobody has requested for this long are dropped.
_KEPT_SECONDS = 10.0

# The pace of environments without a render_fps, and the longest wait of a step.
_USUAL_FPS = 30.0
_LONGEST_PACE = 1.0


def usable_fps(fps: object) -> float:
    """Return how many steps a second to show, given an environment's render_fps."""
    if isinstance(fps, (int, float)) and 1 / _LONGEST_PACE <= fps <= 10_000:
        return float(fps)
    return _USUAL_FPS


class Frame(NamedTuple):
    """What watchers see of a sub-environment at one moment.

    Attributes:
        number: unique among the frames of this environment.
        resets_and_steps: how many of the environment's resets and steps had started.
        body: the response for watchers, JSON.
        used: when it was last requested, in the clock's seconds.
    """

    number: int
    resets_and_steps: int
    body: bytes
    used: float


class Viewer:
    """Shows one environment to its watchers, and limits its pace if that is wanted.

    Attributes:
        fps: how many steps a second to show; see ``usable_fps()``.
    """

    def __init__(self, watchable: Watchable) -> None:
        """Start without frames."""
        self._watchable = watchable
        self.fps = _USUAL_FPS
        # Guards the attributes below; never held while drawing, sending, or waiting for the
        # environment.
        self._changed = threading.Condition()
        self._frames: dict[int, Frame] = {}
        self._numbers = 0
        self._drawing = False
        self._due = 0.0
        self._waiting = 0
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
        with self._changed:
            self._waiting += 1
        try:
            while True:
                frame = self._await(sub_env, after, deadline)
                if frame is not None:
                    return frame.body
                try:
                    self._draw(sub_env, deadline)
                finally:
                    with self._changed:
                        self._drawing = False
                        self._changed.notify_all()
        except Busy:
            with self._changed:
                if self._ended is not None:
                    raise self._ended from None
            return dumps({"number": after, "state": "busy"})
        finally:
            with self._changed:
                self._waiting -= 1
                self._stay()

    def note_presence(self) -> None:
        """Count a watcher as watching for a while, without sending a frame."""
        with self._changed:
            if self._ended is not None:
                raise self._ended
            self._stay()

    @property
    def is_watched(self) -> bool:
        """Whether somebody is watching."""
        return self._waiting > 0 or time.monotonic() < self._stays_until

    def _stay(self) -> None:
        self._stays_until = time.monotonic() + _STAYS_SECONDS

    def _await(self, sub_env: int, after: int | None, deadline: float) -> Frame | None:
        """Return the frame for a watcher, or None if the caller must draw it."""
        with self._changed:
            while True:
                if self._ended is not None:
                    raise self._ended
                now = time.monotonic()
                frame, begun = self._frames.get(sub_env), self._watchable.resets_and_steps
                stale = frame is None or frame.resets_and_steps != begun
                due = now >= self._due
                if frame is not None:
                    new = frame.number != after and not (stale and due)
                    if new or now >= deadline:
                        self._frames[sub_env] = frame._replace(used=now)
                        return frame
                if stale and due and not self._drawing:
                    self._drawing = True
                    return None
                if now >= deadline:
                    # No frame was ever drawn.
                    raise Busy
                if stale and not self._drawing:
                    self._changed.wait(min(self._due, deadline) - now)
                elif self._drawing or self._waits_for_step(frame):
                    self._changed.wait(deadline - now)

    def _waits_for_step(self, frame: Frame | None) -> bool:
        """Ask to be woken at the next reset or step; return False if it may have happened.

        1. A watcher finds that its frame shows the last step.
        2. The environment is stepped, which wakes nobody yet.
        3. The watcher asks to be woken, and would miss the step of 2.

        So this compares the number of steps again after 3.
        """
        self._watchable.on_next = self._on_step
        return frame is not None and frame.resets_and_steps == self._watchable.resets_and_steps

    def _on_step(self) -> None:
        """Wake the threads that wait for a reset or step."""
        with self._changed:
            self._changed.notify_all()

    # Drawing --------------------------------------------------------------------------------

    def _draw(self, sub_env: int, deadline: float) -> None:
        captured = capture(self._watchable, sub_env, deadline, self._may_wait_until)
        facts, frame = captured.facts, captured.frame
        # Encode without the lock, so that the environment can continue.
        facts["frame"] = None if frame is None else base64.b64encode(png(frame)).decode("ascii")
        body = dumps({"number": self._numbers + 1, **facts})
        with self._changed:
            share = _PACED_SHARE if self._next_tick > captured.began - 1 else _SHARE
            # The first frame takes longer, because the environment loads fonts and colours.
            wait = captured.seconds / share if self._numbers else 0.0
            self._due = captured.began + max(_LEAST_SECONDS, wait)
            self._numbers += 1
            now = time.monotonic()
            self._frames[sub_env] = Frame(self._numbers, captured.resets_and_steps, body, now)
            old = [key for key, one in self._frames.items() if one.used < now - _KEPT_SECONDS]
            for other in old:
                del self._frames[other]

    def _may_wait_until(self, deadline: float) -> bool:
        return self._ended is None and time.monotonic() < deadline

    # For the instance -----------------------------------------------------------------------

    def pace(self) -> None:
        """Sleep until the environment's next step is due, if somebody watches."""
        if not self.is_watched:
            return
        with self._changed:
            now = time.monotonic()
            if self._ended is not None:
                return
            tick = max(now, self._next_tick)
            self._next_tick = tick + 1 / self.fps
        if tick > now:
            self._ending.wait(tick - now)

    def end(self, why: GymServerError) -> None:
        """Answer every watcher with an error from now on."""
        with self._changed:
            self._ended = why
            self._changed.notify_all()
        self._ending.set()
