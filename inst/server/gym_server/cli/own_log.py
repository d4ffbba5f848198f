"""Keeps the log short that a program has its server write into a file."""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path

# A log beyond this is cut to so much of its end; it is looked at so often.
_MOST_BYTES = 2**23
_KEPT_BYTES = 2**20
_TICK_SECONDS = 1.0


def keep_short(file: Path) -> None:
    """Shorten the log whenever it is too long; never returns.

    Args:
        file: where standard error goes.
    """
    while True:
        time.sleep(_TICK_SECONDS)
        # It may be gone, with the folder that it was in.
        with contextlib.suppress(OSError):
            shorten(file, 2)


def shorten(file: Path, descriptor: int) -> None:
    """Keep only the end of a file that is too long.

    The server's processes have inherited the descriptor, and with it the position at which they
    write, so all of them write on after what is kept. What they write at this very moment may be
    lost.

    Args:
        file: the file.
        descriptor: by which it is written.
    """
    if file.stat().st_size <= _MOST_BYTES:
        return
    with open(file, "rb") as log:
        log.seek(-_KEPT_BYTES, os.SEEK_END)
        # The rest of a line.
        log.readline()
        kept = log.read()
    os.lseek(descriptor, 0, os.SEEK_SET)
    os.ftruncate(descriptor, 0)
    os.write(descriptor, kept)
