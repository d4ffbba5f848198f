"""How much memory this process and its descendants hold, and how to return it to the system."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from typing import TypeVar

ResultT = TypeVar("ResultT")

# glibc's numbers for two settings of mallopt(), and our values. A block of _LARGE_BYTES or more,
# such as a request's body, gets its own mapping, which is returned to the system when it is freed.
# A heap keeps at most _FREE_BYTES free at its end.
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_LARGE_BYTES = 2**20
_FREE_BYTES = 2**22


def _glibc(name: str) -> Callable[..., int] | None:
    # macOS, Windows and musl have no such functions; they return memory by themselves.
    return getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None


_malloc_trim = _glibc("malloc_trim")
_mallopt = _glibc("mallopt")


def prepare() -> None:
    """Prepare for ``give_back()``; call it once, when all modules are loaded.

    Exempts the objects that exist now, mostly code, from later garbage collections. A collection
    that finds nothing then takes microseconds instead of 25 ms, in which no call is answered.

    Fixes glibc's two thresholds. Otherwise glibc raises them to the size of freed blocks, up to 32
    MiB, and keeps that much at the end of each heap.
    """
    gc.collect()
    gc.freeze()
    if _mallopt is not None:
        _mallopt(_M_MMAP_THRESHOLD, _LARGE_BYTES)
        _mallopt(_M_TRIM_THRESHOLD, _FREE_BYTES)


def give_back(garbage: bool = True) -> None:
    """Collect garbage and return free memory to the system.

    Environments contain reference cycles, so closed ones stay until Python collects garbage, which
    depends on the number of new objects and not on their size. glibc has a heap for every few
    threads, and keeps its free memory as long as any later block is in use.

    Args:
        garbage: whether to collect garbage first; takes longer the more objects there are.
    """
    if garbage:
        gc.collect()
    if _malloc_trim is not None:
        _malloc_trim(0)


# Measuring ----------------------------------------------------------------------------------

_MEASURES = sys.platform == "linux"
_PAGE = os.sysconf("SC_PAGE_SIZE") if _MEASURES else 0


def own_bytes() -> int:
    """Return the unshared memory of this process; 0 if unknown."""
    return _resident(os.getpid()) if _MEASURES else 0


def measured(call: Callable[[], ResultT]) -> tuple[ResultT, int]:
    """Call a function; return its result, and by how many bytes this process grew meanwhile."""
    before = own_bytes()
    result = call()
    return result, own_bytes() - before


def descendants(pid: int) -> dict[int, int]:
    """Return the descendants of a process, each with its parent, and after it."""
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
    """Return the unshared memory of a process; 0 if it has ended.

    Args:
        pid: its number.
        exactly: whether to exclude pages that a fork still shares with its parent, which takes a
            millisecond or more.
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
    """Return a file that describes a process, or "" if the process has ended."""
    try:
        with open(f"/proc/{pid}/{name}", encoding="utf-8", errors="replace") as file:
            return file.read()
    except OSError:
        return ""
