"""What an environment's monitor writes: how much, and when it must stop."""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from gym_server.errors import GymServerError
from gym_server.monitoring.disk_use import DiskUse

log = logging.getLogger(__name__)

# How often the files are measured; episodes may be shorter.
_MEASURE_SECONDS = 1.0


class Recording:
    """The files of an environment's monitor, whatever process writes them."""

    def __init__(self, close_monitor: Callable[[], None]) -> None:
        """Start without a monitor; the argument is the function that ends one."""
        self._close_monitor = close_monitor
        self._written: tuple[Path, DiskUse] | None = None
        # When they were last measured, and why the last monitor had to stop.
        self._measured = 0.0
        self._full: GymServerError | None = None

    def begin(self, path: Path, disk_use: DiskUse) -> None:
        """Count what a new monitor writes to a directory."""
        self._written, self._full = (path, disk_use), None
        self._measure()

    def stop_if_full(self) -> None:
        """Stop the monitor if monitors have no more space; the environment continues."""
        if self._written is None or time.monotonic() < self._measured + _MEASURE_SECONDS:
            return
        path, disk_use = self._written
        self._measure()
        try:
            disk_use.check(path)
        except GymServerError as full:
            log.warning("%s", full.message)
            with contextlib.suppress(GymServerError), self.ends():
                self._close_monitor()
            self._full = full

    @contextlib.contextmanager
    def ends(self) -> Iterator[None]:
        """Measure the files at the end of the monitor; raise if it had no more space."""
        try:
            yield
        finally:
            self._measure()
            self._written = None
        full, self._full = self._full, None
        if full is not None:
            raise full

    def _measure(self) -> None:
        if self._written is not None:
            path, disk_use = self._written
            disk_use.measure(path)
            self._measured = time.monotonic()
