"""Measure the memory of the server and its processes, on Linux."""

from __future__ import annotations

import os
from collections.abc import Iterable

from gym_server.errors import GymServerError
from gym_server.processes import memory

_MB = 2**20

# Memory that is not charged to clients: modules that are imported for the first environment of a
# kind (150 MiB after making and drawing one of each of Gymnasium's kinds), and stored responses.
_OWN_BYTES = 512 * _MB


class Account:
    """Measures the memory of the server and its processes, and refuses to exceed the limit.

    Creating an environment is charged an estimate in advance, see ``memory_estimate``. This class
    covers all later growth. On systems other than Linux nothing is measured, and only the estimates
    apply.
    """

    def __init__(self, limit: float) -> None:
        """Measure what the server uses now, which does not count.

        Args:
            limit: the limit in bytes.
        """
        self._limit = limit
        self._at_start = memory.own_bytes() + _OWN_BYTES
        self._descendants: dict[int, int] = {}
        self._of_processes: dict[int, int] = {}

    def measure(self) -> None:
        """Measure the processes, which takes some milliseconds."""
        self._descendants = memory.descendants(os.getpid())
        # The quick measurement counts shared pages several times; be exact only if it exceeds the
        # limit.
        for exactly in (False, True):
            self._of_processes = {pid: memory.bytes_of(pid, exactly) for pid in self._descendants}
            if not self.is_exceeded:
                return

    @property
    def held(self) -> float:
        """The bytes in use: the server's now, and the processes' when last measured."""
        return memory.own_bytes() - self._at_start + sum(self._of_processes.values())

    @property
    def is_exceeded(self) -> bool:
        """Whether the limit is exceeded."""
        return self.held > self._limit

    def of(self, pids: Iterable[int]) -> int:
        """Return the memory of processes and their descendants when last measured."""
        family = set(pids)
        # A process comes after its parent.
        for pid, parent in self._descendants.items():
            if parent in family:
                family.add(pid)
        return sum(self._of_processes.get(pid, 0) for pid in family)

    def check(self) -> None:
        """Refuse calls that take more memory.

        Raises:
            GymServerError: ``too_much_memory``.
        """
        if self.is_exceeded:
            raise GymServerError(
                "too_much_memory",
                f"All environments together use {self.held / _MB:,.0f} MiB, and may use "
                f"{self._limit / _MB:,.0f} MiB",
                "close what is not needed, GET /v1/instances/ lists it; the server's option "
                "--max-memory-mb sets the limit",
            )
