"""What the server and its processes really hold of memory, on Linux."""

from __future__ import annotations

import os
from collections.abc import Iterable

from gym_server.errors import GymServerError
from gym_server.processes import memory

_MB = 2**20

# What is not the clients': modules that are imported when the first environment of a kind is made
# (150 MiB when one of each of Gymnasium's kinds was made and drawn), answers kept for repetitions.
_OWN_BYTES = 512 * _MB


class Account:
    """Measures what the server and its processes hold, and refuses what would make it more.

    An environment that is created is charged by an estimate beforehand, see ``memory_estimate``.
    This account holds for everything that grows afterwards. Elsewhere than on Linux nothing is
    measured, and the estimates alone hold.
    """

    def __init__(self, limit: float) -> None:
        """Begin with what the server holds now, which does not count.

        Args:
            limit: how many bytes there may be.
        """
        self._limit = limit
        self._at_start = memory.own_bytes() + _OWN_BYTES
        self._descendants: dict[int, int] = {}
        self._of_processes: dict[int, int] = {}

    def measure(self) -> None:
        """Look at the processes, which takes some milliseconds."""
        self._descendants = memory.descendants(os.getpid())
        # Forked pages count several times; only if all are too much are they left out.
        for exactly in (False, True):
            self._of_processes = {pid: memory.bytes_of(pid, exactly) for pid in self._descendants}
            if not self.is_exceeded:
                return

    @property
    def held(self) -> float:
        """How many bytes are held, by the server now and by the processes when last measured."""
        return memory.own_bytes() - self._at_start + sum(self._of_processes.values())

    @property
    def is_exceeded(self) -> bool:
        """Whether that is more than there may be."""
        return self.held > self._limit

    def of(self, pids: Iterable[int]) -> int:
        """Return what processes and those that they have started held when last measured."""
        family = set(pids)
        # A process comes after the one that has started it.
        for pid, parent in self._descendants.items():
            if parent in family:
                family.add(pid)
        return sum(self._of_processes.get(pid, 0) for pid in family)

    def check(self) -> None:
        """Refuse what takes more memory.

        Raises:
            GymServerError: ``too_much_memory``.
        """
        if self.is_exceeded:
            raise GymServerError(
                "too_much_memory",
                f"All environments together hold {self.held / _MB:,.0f} MiB, and "
                f"{self._limit / _MB:,.0f} MiB are what they may hold",
                "close what is not needed, GET /v1/instances/ lists it; the server's option "
                "--max-memory-mb sets the limit",
            )
