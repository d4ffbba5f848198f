"""What the watchers of an environment see: drawn only while one of them asks.

A watcher asks for something newer than what it has (a long poll), and in the thread of that
request the environment is drawn, for all who ask.  So whoever leaves stops the drawing by not
asking again, what one reads slowly is its own affair, and the thread that steps the environment
only counts its moves.
"""

from __future__ import annotations

import base64
import threading
import time
from typing import TYPE_CHECKING, NamedTuple

from gym_server.errors import GymServerError
from gym_server.protocol.answers import dumps
from gym_server.rendering.png import png
from gym_server.viewing.capture import Busy, glimpse

if TYPE_CHECKING:
    from gym_server.instances.instance import Instance

# Between two pictures of one environment, however many watch it.
_LEAST_SECONDS = 1 / 30

# The share of the time in which drawing may keep an environment from its steps.
_SHARE = 0.2
# Where they wait for people's eyes anyway.
_PACED_SHARE = 0.5

# A watcher hears after this long that nothing has moved; shorter than proxies are patient.
_LONGEST_WAIT = 15.0

# How long after its last question a watcher is taken to be still there.
_STAYS_SECONDS = 2.0

# Pictures of sub-environments that nobody has asked for since.
_KEPT_SECONDS = 10.0

# What environments without a speed of their own move at, and the longest that one step waits.
_USUAL_FPS = 30.0
_LONGEST_PACE = 1.0


class Shot(NamedTuple):
    """What was seen of a sub-environment.

    Attributes:
        number: tells it from every other of this environment.
        moves: how often the environment had moved.
        body: the answer for watchers, JSON.
        seen: when it was last asked for, in the clock's seconds.
    """

    number: int
    moves: int
    body: bytes
    seen: float


class Screen:
    """Shows one environment to its watchers, and keeps its pace where that is wanted."""

    def __init__(self, instance: Instance, fps: object) -> None:
        """Show nothing yet.

        Args:
            instance: what is watched.
            fps: how many steps a second the environment takes for human eyes.
        """
        self._instance = instance
        good = isinstance(fps, (int, float)) and 1 / _LONGEST_PACE <= fps <= 10_000
        self.fps = float(fps) if good else _USUAL_FPS  # type: ignore[arg-type]
        # Guards what follows; never held while drawing, sending or waiting for the instance.
        self._changed = threading.Condition()
        self._shots: dict[int, Shot] = {}
        self._numbers = 0
        self._drawing = False
        self._due = 0.0
        self._asking = 0
        self._stays_until = 0.0
        self._ended: GymServerError | None = None
        self._ending = threading.Event()
        self._next_tick = 0.0

    # For watchers ---------------------------------------------------------------------------

    def see(self, sub_env: int, after: int | None) -> bytes:
        """Wait for something that a watcher has not seen.

        Args:
            sub_env: which sub-environment to look at.
            after: the number of what it saw last.

        Returns:
            What there is to see, as JSON: what ``Instance.look()`` tells, a "number" and a
            "frame", a PNG in Base64.  What it has seen already when nothing moves for long; of
            an environment that cannot be drawn for long only the "state".

        Raises:
            GymServerError: ``unknown_instance`` when the environment is closed meanwhile,
                ``shutting_down``.
        """
        deadline = time.monotonic() + _LONGEST_WAIT
        with self._changed:
            self._asking += 1
        try:
            while True:
                shot = self._await(sub_env, after, deadline)
                if shot is not None:
                    return shot.body
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
                self._asking -= 1
                self._stay()

    def attend(self) -> None:
        """Count as watching for a while, without a look."""
        with self._changed:
            if self._ended is not None:
                raise self._ended
            self._stay()

    @property
    def is_watched(self) -> bool:
        """Whether somebody watches."""
        return self._asking > 0 or time.monotonic() < self._stays_until

    def _stay(self) -> None:
        self._stays_until = time.monotonic() + _STAYS_SECONDS

    def _await(self, sub_env: int, after: int | None, deadline: float) -> Shot | None:
        """Return what answers a watcher, or None when it has to draw."""
        with self._changed:
            while True:
                if self._ended is not None:
                    raise self._ended
                now = time.monotonic()
                shot = self._shots.get(sub_env)
                stale = shot is None or shot.moves != self._instance.moves
                due = now >= self._due
                if shot is not None:
                    new = shot.number != after and not (stale and due)
                    if new or now >= deadline:
                        self._shots[sub_env] = shot._replace(seen=now)
                        return shot
                if stale and due and not self._drawing:
                    self._drawing = True
                    return None
                if now >= deadline:
                    # One that was never drawn waits no longer than others.
                    raise Busy
                if stale and not self._drawing:
                    self._changed.wait(min(self._due, deadline) - now)
                elif self._drawing or self._wants_call(shot):
                    self._changed.wait(deadline - now)

    def _wants_call(self, shot: Shot | None) -> bool:
        """Ask to be called at the next move; return False when that was just now."""
        self._instance.on_move = self.call
        return shot is not None and shot.moves == self._instance.moves

    def call(self) -> None:
        """Wake those that wait for a move."""
        with self._changed:
            self._changed.notify_all()

    # Drawing --------------------------------------------------------------------------------

    def _draw(self, sub_env: int, deadline: float) -> None:
        seen = glimpse(self._instance, sub_env, deadline, self._is_patient)
        facts, frame = seen.facts, seen.frame
        # The instance goes on while this is put into words.
        facts["frame"] = None if frame is None else base64.b64encode(png(frame)).decode("ascii")
        body = dumps({"number": self._numbers + 1, **facts})
        with self._changed:
            share = _PACED_SHARE if self._next_tick > seen.began - 1 else _SHARE
            # The first time it finds its screen, its fonts, its colours.
            wait = seen.held / share if self._numbers else 0.0
            self._due = seen.began + max(_LEAST_SECONDS, wait)
            self._numbers += 1
            now = time.monotonic()
            self._shots[sub_env] = Shot(self._numbers, seen.moves, body, now)
            for other in [key for key, s in self._shots.items() if s.seen < now - _KEPT_SECONDS]:
                del self._shots[other]

    def _is_patient(self, until: float) -> bool:
        return self._ended is None and time.monotonic() < until

    # For the instance -----------------------------------------------------------------------

    def pace(self) -> None:
        """Sleep until the environment's next move is due, when somebody watches."""
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
        """Send every watcher away."""
        with self._changed:
            self._ended = why
            self._changed.notify_all()
        self._ending.set()
