"""How much all monitors have written to the disk, and whether that is too much."""

from __future__ import annotations

import contextlib
import os
import re
import threading
from pathlib import Path

from gym_server.errors import GymServerError

# Files take whole blocks.
_BLOCK_BYTES = 4096

_WRITTEN_BY_MONITORS = ("episodes", "rl-video")

_INSTANCE_ID = re.compile("[0-9a-f]{8}")


class DiskUse:
    """The disk space of the directories that monitors have written since the server started."""

    def __init__(self, most_bytes: float) -> None:
        """Start with no directories.

        Args:
            most_bytes: the limit for all of them together.
        """
        self._most_bytes = most_bytes
        self._lock = threading.Lock()
        self._sizes: dict[Path, int] = {}
        self._total = 0

    def measure(self, path: Path) -> None:
        """Measure the monitors' files in a directory."""
        with self._lock:
            size = _size(path)
            self._total += size - self._sizes.get(path, 0)
            self._sizes[path] = size

    def check(self, path: Path, emptied: bool = False) -> None:
        """Refuse to write more if all directories together take too much.

        Args:
            path: the directory to write to.
            emptied: whether its contents will be deleted first.

        Raises:
            GymServerError: ``monitors_full``.
        """
        if self._total - (self._sizes.get(path, 0) if emptied else 0) >= self._most_bytes:
            raise GymServerError(
                "monitors_full",
                f"Recording stopped in {path}: all monitors together have written "
                f"{self._total / 2**20:.0f} MiB since this server started, and may write "
                f"{self._most_bytes / 2**20:.0f}",
                "record with force = true into a directory whose recordings are not needed; the "
                "server's option --max-monitor-mb sets the limit",
            )


def own_directories(path: Path) -> list[Path]:
    """Return the subdirectories of monitors that shared this directory with another one."""
    return [path / name for name in os.listdir(path) if _INSTANCE_ID.fullmatch(name)]


def _size(path: Path) -> int:
    blocks = 0
    # Directories and files may just have been removed.
    with contextlib.suppress(OSError):
        for directory in (path, *own_directories(path)):
            blocks += 1
            with contextlib.suppress(OSError):
                for name in os.listdir(directory):
                    if name.startswith(_WRITTEN_BY_MONITORS):
                        blocks += -(-os.lstat(directory / name).st_size // _BLOCK_BYTES)
    return blocks * _BLOCK_BYTES
