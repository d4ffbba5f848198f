"""A request for rollouts: the units to play, and their results."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from gym_server.errors import GymServerError
from gym_server.rollouts.task import MOST_BYTES, Task, Unit

# A player takes units for this many seconds at once, when their duration is known. Its process
# stops earlier and returns the rest.
_SECONDS_TAKEN = 0.03
_FIRST_TAKEN = 4
_MOST_TAKEN = 2000


@dataclass(eq=False)
class RolloutRequest:
    """Units that a client waits for.

    Attributes:
        task: what all units have in common.
        function: the function to call in the process: "play" or "describe".
        units: all units.
        waiting: the ranges of units that are not being played, in order.
        playing: how many ranges are being played.
        results: for each played range, by its first unit: how many units, and their tensors.
        size: the bytes of all results.
        seconds: the duration of a unit, or None if unknown.
        deaths: how often a process has died while playing a unit.
        failed: the first unit that failed, and the error.
        unwanted_since: since when nobody waits for it, in the clock's seconds.
        over: set when it is done.
    """

    task: Task
    function: str
    units: Sequence[Unit]
    waiting: deque[range] = field(default_factory=deque)
    playing: int = 0
    results: dict[int, tuple[int, Any]] = field(default_factory=dict)
    size: int = 0
    seconds: float | None = None
    deaths: dict[int, int] = field(default_factory=dict)
    failed: tuple[int, GymServerError] | None = None
    unwanted_since: float | None = None
    over: threading.Event = field(default_factory=threading.Event)

    def take(self, players: int) -> range | None:
        """Take some units to play; None if there are none."""
        if not self.has_work:
            return None
        first = self.waiting[0]
        count = _FIRST_TAKEN if self.seconds is None else int(_SECONDS_TAKEN / self.seconds)
        share = -(-sum(map(len, self.waiting)) // players)
        count = max(1, min(count, share, _MOST_TAKEN, len(first)))
        taken = first[:count]
        if count < len(first):
            self.waiting[0] = first[count:]
        else:
            self.waiting.popleft()
        self.playing += 1
        return taken

    def give_back(self, units: range) -> None:
        """Return units for another player."""
        if units:
            self.waiting.appendleft(units)
            self.waiting = deque(sorted(self.waiting, key=lambda one: one.start))

    def fail(self, unit: int, error: GymServerError) -> None:
        """Note that a unit has failed."""
        if self.failed is None or unit < self.failed[0]:
            self.failed = (unit, error)

    @property
    def is_over(self) -> bool:
        """Whether nothing is being played or will be."""
        return self.playing == 0 and not self.has_work

    @property
    def has_work(self) -> bool:
        """Whether there are units to play."""
        is_full = self.size > MOST_BYTES and 0 in self.results
        if not self.waiting or self.unwanted_since is not None or is_full:
            return False
        return self.failed is None or self.waiting[0].start < self.failed[0]

    def beginning(self) -> tuple[list[Any], int]:
        """Return the results of the units before the first gap, and the number of these units."""
        results = []
        end = 0
        while end in self.results:
            done, tensors = self.results[end]
            results.append(tensors)
            end += done
        return results, end
