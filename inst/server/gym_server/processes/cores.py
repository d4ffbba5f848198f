"""How many cores this process may use, and which of them the processes use that it has started."""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Sequence
from pathlib import Path

_CGROUP = Path("/sys/fs/cgroup")


def usable_cores(cgroup: Path = _CGROUP) -> int:
    """Return how many cores this process may use: those of its affinity, within its cgroup's limit.

    Args:
        cgroup: where the system shows control groups, of version 2 or 1.
    """
    if hasattr(os, "sched_getaffinity"):
        cores = len(os.sched_getaffinity(0))
    else:
        cores = os.cpu_count() or 1
    return max(1, math.ceil(min(cores, _cgroup_limit(cgroup))))


def _cgroup_limit(cgroup: Path) -> float:
    """Return the limit in cores, infinity for none."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        quota, period = (cgroup / "cpu.max").read_text().split()
        return float(quota) / float(period) if quota != "max" else math.inf
    with contextlib.suppress(OSError, ValueError, IndexError):
        quota = (cgroup / "cpu" / "cpu.cfs_quota_us").read_text()
        period = (cgroup / "cpu" / "cpu.cfs_period_us").read_text()
        return float(quota) / float(period) if float(quota) > 0 else math.inf
    return math.inf


def spread(pids: Sequence[int]) -> None:
    """Give each of some processes cores of its own, of those that this process may use.

    They are woken at the same time, and Linux often wakes two of them on the same core and leaves
    them there: a step of a LunarLander, one of 256 in two processes on two cores, took 36 us (three
    runs of 78 steps of all), and takes 19 to 25 us since (two runs).
    """
    if not hasattr(os, "sched_setaffinity"):
        return
    cores = sorted(os.sched_getaffinity(0))
    shares = [
        cores[place :: len(pids)] or [cores[place % len(cores)]] for place in range(len(pids))
    ]
    for pid, share in zip(pids, shares, strict=True):
        # It may have ended, or be kept from it by the system's administrator.
        with contextlib.suppress(OSError):
            os.sched_setaffinity(pid, share)
