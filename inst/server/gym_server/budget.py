"""Memory that many share: a total, and what each of them holds of it."""

from __future__ import annotations

import threading


class Budget:
    """Bytes that all together may hold."""

    def __init__(self, most: int) -> None:
        """Have so many."""
        self._left = most
        self._lock = threading.Lock()

    def share(self) -> Share:
        """Return the share of one more, which holds nothing yet."""
        return Share(self)

    def _move(self, size: int) -> bool:
        if size > self._left:
            return False
        self._left -= size
        return True


class Share:
    """What one of those who share a budget holds."""

    def __init__(self, budget: Budget) -> None:
        self._budget = budget
        self._held = 0

    def take(self, size: int) -> bool:
        """Hold so many bytes more; return whether there are as many."""
        with self._budget._lock:
            taken = self._budget._move(size)
            if taken:
                self._held += size
            return taken

    def give_back(self, size: int) -> None:
        """Hold so many bytes less; what was given back before is not given back again."""
        with self._budget._lock:
            size = min(size, self._held)
            self._held -= size
            self._budget._move(-size)

    def give_all_back(self) -> None:
        """Hold nothing any more."""
        self.give_back(self._held)
