"""Limits on what all clients of a server use together."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from dataclasses import dataclass

from gym_server.errors import GymServerError
from gym_server.processes.cores import usable_cores


@dataclass(frozen=True)
class Room:
    """What an environment takes of the limits on all environments together.

    Attributes:
        sub_envs: how many it has; one without sub-environments counts as one.
        processes: how many of its own run it.
    """

    sub_envs: int = 1
    processes: int = 0

    def __add__(self, other: Room) -> Room:
        """Return both together."""
        return Room(self.sub_envs + other.sub_envs, self.processes + other.processes)


@dataclass(frozen=True)
class Limits:
    """What a server allows; the defaults leave a lab's server on one machine standing.

    Attributes:
        max_instances: how many environments there may be.
        max_num_envs: how many sub-environments one of them may have.
        max_total_sub_envs: how many all of them may have together, where one without
            sub-environments counts as one; None for four times as many as one may have.
        max_processes: how many processes all of them may have together. However many processors
            there are, each takes 7 MB of its own when it is created and 20 MB in use, two threads
            and 15 files, whether it is used or not; this is a class in which everybody has some
            isolated ones, or sub-environments in processes.
        max_rollout_processes: how many processes play whole episodes, beside these; None for one a
            core. None do where there may be no processes at all.
        max_memory_mb: how much memory all of them may take together, in MiB, as it is estimated
            beforehand (``memory_estimate``) and measured afterwards (``Account``). Half of what a
            small machine has.
        max_monitor_mb: how much all monitors together may write on the disk until the server ends,
            in MiB; some hundred thousand short videos.
        max_watchers: how many pages may be shown something at a time.
        max_call_seconds: how long one call may take before its instance is evicted; 0 for no limit.
            Longer than an ordinary call takes, and short enough that somebody who comes back from
            a coffee finds the error.
        idle_minutes: how long nobody may have used or watched an instance before it is evicted;
            0 for no limit. A day: what is left in the evening is still there in the morning.
    """

    max_instances: int = 1000
    max_num_envs: int = 16384
    max_total_sub_envs: int | None = None
    max_processes: int = 128
    max_rollout_processes: int | None = None
    max_memory_mb: int = 4096
    max_monitor_mb: float = 4096
    max_watchers: int = 100
    max_call_seconds: float = 300.0
    idle_minutes: float = 24 * 60.0

    @property
    def rollout_processes(self) -> int:
        """How many processes play whole episodes."""
        wanted = self.max_rollout_processes
        return min(usable_cores() if wanted is None else wanted, self.max_processes)

    def check_room(self, instances: int, taken: Room, more: Room) -> None:
        """Refuse an environment for which there is no room.

        Args:
            instances: how many there are.
            taken: what they have.
            more: what the new one is to have.

        Raises:
            GymServerError: ``too_many_instances``, ``too_many_sub_envs``, ``too_many_processes``.
        """
        if instances >= self.max_instances:
            raise GymServerError(
                "too_many_instances",
                f"This server has {self.max_instances} environments, and takes no more",
                "close some, GET /v1/instances/ lists them; the server's option --max-instances "
                "sets the limit",
            )
        most = self.max_total_sub_envs or 4 * self.max_num_envs
        # An environment that is larger than any may be is refused for that when it is created.
        if taken.sub_envs + more.sub_envs > most and more.sub_envs <= self.max_num_envs:
            raise GymServerError(
                "too_many_sub_envs",
                f"All environments together may have {most} sub-environments, and "
                f"{max(0, most - taken.sub_envs)} are left, not {more.sub_envs}",
                "close some, GET /v1/instances/ lists them; the server's option "
                "--max-total-sub-envs sets the limit",
            )
        left = self.max_processes - taken.processes
        if more.processes > max(0, left):
            raise GymServerError(
                "too_many_processes",
                f"All environments together may have {self.max_processes} processes, and "
                f"{max(0, left)} are left, not {more.processes}",
                "close some, GET /v1/instances/ lists them, or let fewer processes run sub-"
                "environments (num_workers); the server's option --max-processes sets the limit",
            )


class Watchers:
    """Counts the watchers that wait for a frame, of all environments."""

    def __init__(self, most: int) -> None:
        """Allow so many at a time."""
        self._most = most
        self._lock = threading.Lock()
        self._count = 0

    @contextlib.contextmanager
    def one_more(self) -> Iterator[None]:
        """Count one more watcher for a while.

        Raises:
            GymServerError: ``too_many_watchers``.
        """
        with self._lock:
            if self._count >= self._most:
                raise GymServerError(
                    "too_many_watchers",
                    f"This server shows environments to {self._most} watchers, and takes no more",
                    "close a page; the server's option --max-watchers sets the limit",
                )
            self._count += 1
        try:
            yield
        finally:
            with self._lock:
                self._count -= 1
