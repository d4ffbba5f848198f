"""Lock a file for one process, until the file is closed or the process ends."""

from __future__ import annotations

import errno
import os
import sys
from typing import IO

if sys.platform == "win32":
    import msvcrt

    # Windows prevents others from reading a locked part, so lock one far behind the file's end.
    _FAR_BEHIND = 2**30

    def _lock(descriptor: int) -> None:
        os.lseek(descriptor, _FAR_BEHIND, os.SEEK_SET)
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        finally:
            os.lseek(descriptor, 0, os.SEEK_END)

else:
    import fcntl

    def _lock(descriptor: int) -> None:
        # lockf() locks belong to the process, which could take one twice, and they end when any
        # other handle of the file is closed.
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def try_lock(file: IO) -> bool:
    """Lock an open file until it is closed; return False if it is already locked.

    Raises:
        OSError: the file system does not support locks.
    """
    try:
        _lock(file.fileno())
    except OSError as error:
        if error.errno in (errno.EWOULDBLOCK, errno.EACCES, errno.EDEADLK):
            return False
        raise
    return True
