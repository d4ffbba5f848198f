"""A memory limit shared by many users."""

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
        self._lock = threading.Lock()

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
