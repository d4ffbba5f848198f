"""Return memory that is no longer used to the system."""

from __future__ import annotations

import ctypes
import gc
import sys
from collections.abc import Callable

# glibc's numbers of two settings of mallopt(), and our values. A block from _LARGE_BYTES on, such
# as a request's body, is a mapping of its own, which goes back to the system when it is freed. A
# pool keeps at most _FREE_BYTES free at its end.
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_LARGE_BYTES = 2**20
_FREE_BYTES = 2**22


def _glibc(name: str) -> Callable[..., int] | None:
    # macOS, Windows and musl return memory without being asked, and have no such functions.
    return getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None


_malloc_trim = _glibc("malloc_trim")
_mallopt = _glibc("mallopt")


def prepare() -> None:
    """Prepare for ``give_back()``; call it once, when all modules are loaded.

    The objects that exist now, most of them code, are taken out of later garbage collections: one
    that finds nothing takes some microseconds instead of 25 ms, in which nothing is answered.

    glibc's two thresholds are fixed, because it raises them to the size of blocks that were freed,
    up to 32 MiB, and keeps that much at the end of each pool.
    """
    gc.collect()
    gc.freeze()
    if _mallopt is not None:
        _mallopt(_M_MMAP_THRESHOLD, _LARGE_BYTES)
        _mallopt(_M_TRIM_THRESHOLD, _FREE_BYTES)


def give_back(garbage: bool = True) -> None:
    """Collect the garbage and return free memory to the system.

    Environments refer to themselves in circles, so closed ones stay until Python's garbage
    collection, which starts by the number of new objects and not by their size. And glibc has a
    pool of memory for every few threads, and keeps what is free there for as long as any block
    behind it is in use.

    Args:
        garbage: whether to collect the garbage first; the more objects there are, the longer it
            takes.
    """
    if garbage:
        gc.collect()
    if _malloc_trim is not None:
        _malloc_trim(0)
