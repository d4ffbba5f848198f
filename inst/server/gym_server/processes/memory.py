"""How much memory this process and those below it have to themselves, and giving it back."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from typing import TypeVar

ResultT = TypeVar("ResultT")

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


# Measuring ----------------------------------------------------------------------------------

_MEASURES = sys.platform == "linux"
_PAGE = os.sysconf("SC_PAGE_SIZE") if _MEASURES else 0


def own_bytes() -> int:
    """Return what this process has in memory and shares with no other; 0 where that is unknown."""
    return _resident(os.getpid()) if _MEASURES else 0


def measured(call: Callable[[], ResultT]) -> tuple[ResultT, int]:
    """Call a function; return its result, and how many bytes this process has grown meanwhile."""
    before = own_bytes()
    result = call()
    return result, own_bytes() - before


def descendants(pid: int) -> dict[int, int]:
    """Return the processes below one, each after and with the one that started it."""
    children: dict[int, list[int]] = defaultdict(list)
    for child, parent in _parents() if _MEASURES else ():
        children[parent].append(child)
    found: dict[int, int] = {}
    waiting = [pid]
    while waiting:
        parent = waiting.pop()
        for child in children[parent]:
            found[child] = parent
            waiting.append(child)
    return found


def bytes_of(pid: int, exactly: bool) -> int:
    """Return what a process has in memory and shares with no other; 0 for one that is gone.

    Args:
        pid: its number.
        exactly: whether to leave out the pages that a fork shares with its parent until one of them
            writes there, which takes a millisecond or more.
    """
    if not exactly:
        return _resident(pid)
    lines = _read(pid, "smaps_rollup").splitlines()
    return 1024 * sum(int(line.split()[1]) for line in lines if line.startswith("Private_"))


def _resident(pid: int) -> int:
    _, resident, shared, *_ = _read(pid, "statm").split() or (0, 0, 0)
    return (int(resident) - int(shared)) * _PAGE


def _parents() -> Iterator[tuple[int, int]]:
    for pid in filter(str.isdigit, os.listdir("/proc")):
        # The number, the name in parentheses, the state, the parent's number.
        if stat := _read(pid, "stat"):
            yield int(pid), int(stat.rpartition(")")[2].split()[1])


def _read(pid: int | str, name: str) -> str:
    """Return what the system says of a process, nothing of one that is gone."""
    try:
        with open(f"/proc/{pid}/{name}", encoding="utf-8", errors="replace") as file:
            return file.read()
    except OSError:
        return ""
