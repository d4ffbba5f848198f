"""Memory that is not used any more goes back to the system."""

from __future__ import annotations

import ctypes
import gc
import sys
from collections.abc import Callable

# glibc's numbers for what mallopt() sets, and to what: what is as large as a body comes from the
# system, each for itself, and goes back there; and how much a pool may have free at its end.
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_LARGE_BYTES = 2**20
_FREE_BYTES = 2**22


def _glibc(name: str) -> Callable[..., int] | None:
    # macOS and Windows give back by themselves, as does musl, which has no such functions.
    return getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None


_malloc_trim = _glibc("malloc_trim")
_mallopt = _glibc("mallopt")


def prepare() -> None:
    """Get ready to give back; call it once, when all is loaded.

    Later collections are spared the look at what is there now, above all code: one that finds
    nothing takes some microseconds instead of 25 ms, in which nobody gets an answer.

    And glibc does not take the size of what was freed for the size that it had better keep, up to
    32 MiB at the end of each of its pools, where nothing gives it back.
    """
    gc.collect()
    gc.freeze()
    if _mallopt is not None:
        _mallopt(_M_MMAP_THRESHOLD, _LARGE_BYTES)
        _mallopt(_M_TRIM_THRESHOLD, _FREE_BYTES)


def give_back(garbage: bool = True) -> None:
    """Collect the garbage, and return what is free.

    Args:
        garbage: whether there may be some; to look for it takes the longer the more there is.

    Environments refer to themselves in circles, so that those that were closed wait for Python's
    collection, which comes by the number of new objects and not by their size. And glibc keeps
    what threads have freed, in a pool for each few of them, for as long as anything that lies
    behind it is in use.
    """
    if garbage:
        gc.collect()
    if _malloc_trim is not None:
        _malloc_trim(0)
