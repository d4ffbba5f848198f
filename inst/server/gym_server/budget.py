"""A limit of memory for many users together, and what each of them holds of it."""

from __future__ import annotations

import math
import threading


class Budget:
    """Bytes that all users together may hold.

    Attributes:
        limit: how many that are.
    """

    def __init__(self, limit: float = math.inf) -> None:
        """Start with all of them left."""
        self.limit = limit
        self._taken = 0.0
        # Reentrant: a share keeps it while it takes bytes and counts what it holds.
        self._lock = threading.RLock()

    @property
    def left(self) -> float:
        """How many bytes are left."""
        return max(0.0, self.limit - self._taken)

    def take(self, size: float) -> bool:
        """Take bytes, if so many are left; return whether they were."""
        with self._lock:
            if not math.isfinite(size) or self._taken + size > self.limit:
                return False
            self._taken += size
            return True

    def give_back(self, size: float) -> None:
        """Give back bytes that were taken."""
        with self._lock:
            self._taken -= size

    def share(self) -> Share:
        """Return the share of one more user, which holds nothing yet."""
        return Share(self)


class Share:
    """What one user of a budget holds."""

    def __init__(self, budget: Budget) -> None:
        self._budget = budget
        self._held = 0

    def take(self, size: int) -> bool:
        """Take so many bytes more, if they are left; return whether they were."""
        with self._budget._lock:
            taken = self._budget.take(size)
            if taken:
                self._held += size
            return taken

    def give_back(self, size: int) -> None:
        """Give back so many bytes, or all where it holds fewer."""
        with self._budget._lock:
            size = min(size, self._held)
            self._held -= size
            self._budget.give_back(size)

    def give_all_back(self) -> None:
        """Give back all that it holds."""
        self.give_back(self._held)
