"""Limit the size of a log file that the server writes for the program that started it."""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path

# A log longer than _MOST_BYTES is cut to its last _KEPT_BYTES; its size is checked this often.
_MOST_BYTES = 2**23
_KEPT_BYTES = 2**20
_TICK_SECONDS = 1.0


def keep_short(file: Path) -> None:
    """Shorten the log whenever it is too long; never returns.

    Args:
        file: the file that standard error is redirected to.
    """
    while True:
        time.sleep(_TICK_SECONDS)
        # The file may have been removed.
        with contextlib.suppress(OSError):
            shorten(file, 2)


def shorten(file: Path, descriptor: int) -> None:
    """Keep only the end of a file that is too long.

    The server's processes have inherited the descriptor, and with it the position, so they all
    continue after the kept part. What they write at this moment may be lost.

    Args:
        file: the file.
        descriptor: the descriptor that it is written by.
    """
    if file.stat().st_size <= _MOST_BYTES:
        return
    with open(file, "rb") as log:
        log.seek(-_KEPT_BYTES, os.SEEK_END)
        # Skip the rest of a line.
        log.readline()
        kept = log.read()
    os.lseek(descriptor, 0, os.SEEK_SET)
    os.ftruncate(descriptor, 0)
    os.write(descriptor, kept)
