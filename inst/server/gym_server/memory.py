"""How much memory this process may take, and how to return it to the system."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import logging
import os
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

log = logging.getLogger(__name__)

_MB = 2**20
CGROUP = Path("/sys/fs/cgroup")

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


def own_group(cgroup: Path = CGROUP) -> Path:
    """Return the folder of this process's control group of version 2.

    Raises:
        FileNotFoundError: it is in none.
    """
    for line in Path("/proc/self/cgroup").read_text().splitlines():
        if line.startswith("0::/"):
            return cgroup / line.removeprefix("0::/")
    raise FileNotFoundError(0, "this process is in no group of version 2")


def machine_mb(cgroup: Path = CGROUP) -> int:
    """Return the memory of the machine in MiB, or of its cgroup if that is less.

    Args:
        cgroup: the mount point of control groups of version 2.
    """
    sizes = [os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")]
    own = cgroup
    with contextlib.suppress(OSError):
        own = own_group(cgroup)
    # A group may have as much as each group above it.
    for group in (own, *own.parents):
        # A group without a limit says "max".
        with contextlib.suppress(OSError, ValueError):
            sizes.append(int((group / "memory.max").read_text()))
    return min(sizes) // _MB


# What threads may take beyond the limit when they start.
_RESERVE_BYTES = 64 * _MB

# The limit, and the limit with the reserve; None if the system has none.
_limits: tuple[int, int] | None = None
_starting = threading.Lock()


def limit(megabytes: int | None) -> None:
    """Let the system limit the memory that this process takes from now on, and later ones take.

    Args:
        megabytes: how much; None for three quarters of the machine's.
    """
    global _limits
    if sys.platform != "linux":
        if megabytes is not None:
            log.warning("This system cannot limit memory, so --max-memory-mb has no effect")
        return
    import resource

    if megabytes is None:
        megabytes = machine_mb() * 3 // 4
    # Not RLIMIT_AS: threads and libraries reserve address space that they never use. What the
    # process has by now is mostly reserved, too: NumPy has a stack for each core.
    size = _taken() + megabytes * _MB
    most = size + _RESERVE_BYTES
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if hard != resource.RLIM_INFINITY:
        size, most = min(size, hard), min(most, hard)

    _limits = size, most
    resource.setrlimit(resource.RLIMIT_DATA, _limits)


def _taken() -> int:
    """Return how many bytes count for the limit."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("VmData:"))


def is_short() -> bool:
    """Return whether more than half of what the limit allows is taken."""
    return _limits is not None and _taken() > _limits[0] // 2


@contextlib.contextmanager
def for_threads() -> Iterator[None]:
    """Start threads meanwhile, with memory that is kept for this.

    A thread that finds no memory for its first call never tells so, and Python's ``start()`` waits
    for it for ever (https://github.com/python/cpython/issues/140746). If there is no memory for its
    stack, ``start()`` raises RuntimeError.
    """
    if _limits is None:
        yield
        return
    import resource

    size, most = _limits
    with _starting:
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_DATA, (size, most))
