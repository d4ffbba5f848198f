"""A memory limit shared by many users, and what each of them holds."""

from __future__ import annotations

import math
import threading


class Budget:
    """Bytes that all users together may hold.

    Attributes:
        limit: the number of bytes.
    """

    def __init__(self, limit: float = math.inf) -> None:
        """Start with everything left."""
        self.limit = limit
        self._taken = 0.0
        # Reentrant: a share holds it while it takes bytes and updates its own count.
        self._lock = threading.RLock()

    @property
    def left(self) -> float:
        """How many bytes are left."""
        return max(0.0, self.limit - self._taken)

    def take(self, size: float) -> bool:
        """Take bytes if that many are left; return whether it succeeded."""
        with self._lock:
            if not math.isfinite(size) or self._taken + size > self.limit:
                return False
            self._taken += size
            return True

    def give_back(self, size: float) -> None:
        """Return bytes to the budget."""
        with self._lock:
            self._taken -= size

    def share(self) -> Share:
        """Return an empty share for one more user."""
        return Share(self)


class Share:
    """The bytes that one user of a budget holds."""

    def __init__(self, budget: Budget) -> None:
        self._budget = budget
        self._held = 0

    def take(self, size: int) -> bool:
        """Take more bytes if that many are left; return whether it succeeded."""
        with self._budget._lock:
            taken = self._budget.take(size)
            if taken:
                self._held += size
            return taken

    def give_back(self, size: int) -> None:
        """Return bytes to the budget: at most as many as this share holds."""
        with self._budget._lock:
            size = min(size, self._held)
            self._held -= size
            self._budget.give_back(size)

    def give_all_back(self) -> None:
        """Return everything to the budget."""
        self.give_back(self._held)
