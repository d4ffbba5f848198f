"""The open streams: an instance has one, the last that was opened. And what messages look like."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from weakref import WeakKeyDictionary

from gym_server.api.exactly_once import ExactlyOnce
from gym_server.api.stream_layout import StreamLayout
from gym_server.instances.instance import Instance


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
        self._layouts: WeakKeyDictionary[Instance, dict[tuple[bool, bool], StreamLayout]] = (
            WeakKeyDictionary()
        )

    def layout(self, instance: Instance, by_column: bool, as_float64: bool) -> StreamLayout:
        """Return the layout of an instance's messages; it is found once, see ``StreamLayout``."""
        layouts = self._layouts.setdefault(instance, {})
        form = by_column, as_float64
        if form not in layouts:
            layouts[form] = StreamLayout(instance, by_column, as_float64)
        return layouts[form]

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
