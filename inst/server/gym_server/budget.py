"""Memory that many share: a total, and what each of them holds of it."""

from __future__ import annotations

import math
import threading


class Budget:
    """Bytes that all together may hold.

    Attributes:
        most: how many that are.
    """

    def __init__(self, most: float = math.inf) -> None:
        """Have all of it left."""
        self.most = most
        self._taken = 0.0
        # A share takes and counts in one go.
        self._lock = threading.RLock()

    @property
    def left(self) -> float:
        """How many bytes are left."""
        return max(0.0, self.most - self._taken)

    def take(self, size: float) -> bool:
        """Take so many bytes of it, if they are left."""
        with self._lock:
            if not math.isfinite(size) or self._taken + size > self.most:
                return False
            self._taken += size
            return True

    def give_back(self, size: float) -> None:
        """Give back what was taken."""
        with self._lock:
            self._taken -= size

    def share(self) -> Share:
        """Return the share of one more, which holds nothing yet."""
        return Share(self)


class Share:
    """What one of those who share a budget holds."""

    def __init__(self, budget: Budget) -> None:
        self._budget = budget
        self._held = 0

    def take(self, size: int) -> bool:
        """Hold so many bytes more; return whether there are as many."""
        with self._budget._lock:
            taken = self._budget.take(size)
            if taken:
                self._held += size
            return taken

    def give_back(self, size: int) -> None:
        """Hold so many bytes less; what was given back before is not given back again."""
        with self._budget._lock:
            size = min(size, self._held)
            self._held -= size
            self._budget.give_back(size)

    def give_all_back(self) -> None:
        """Hold nothing any more."""
        self.give_back(self._held)
