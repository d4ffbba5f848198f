"""The open streams: an instance has one, the last that was opened."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from gym_server.api.exactly_once import ExactlyOnce


class OpenStreams:
    """The open streams, and what all of them share.

    Attributes:
        exactly_once: the answers to requests with a number.
        most_bytes: the size of the largest message.
    """

    def __init__(self, exactly_once: ExactlyOnce, most_bytes: int) -> None:
        """Start without streams."""
        self.exactly_once = exactly_once
        self.most_bytes = most_bytes
        self._lock = threading.Lock()
        # Functions that end them.
        self._ends: dict[str, Callable[[], None]] = {}

    @contextmanager
    def added(self, instance_id: str, end: Callable[[], None]) -> Iterator[None]:
        """Count a stream as open; the instance's earlier one ends.

        Args:
            instance_id: its instance.
            end: ends it, from another thread.
        """
        with self._lock:
            end_earlier = self._ends.get(instance_id)
            self._ends[instance_id] = end
        if end_earlier is not None:
            end_earlier()
        try:
            yield
        finally:
            with self._lock:
                if self._ends.get(instance_id) is end:
                    del self._ends[instance_id]
