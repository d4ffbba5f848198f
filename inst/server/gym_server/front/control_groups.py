"""A control group for each user's server (cgroup v2, Linux): the system divides the machine."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from gym_server.memory import CGROUP, own_group

_CONTROLLERS = "+memory +pids +cpu"

# The threads and processes of one user. A server has a thread for each connection, and each of its
# processes some for linear algebra.
_MOST_TASKS = 4096

# The front hands over everybody's connections, so it comes before a user's server (100, the
# default).
_FRONT_WEIGHT, _USER_WEIGHT = 1000, 100


class ControlGroups:
    """The groups of the users' servers, beside that of the front."""

    def __init__(self) -> None:
        """Make room for groups.

        Raises:
            OSError: the system has no such groups, or this process may not make any.
        """
        if not (CGROUP / "cgroup.controllers").exists():
            raise FileNotFoundError(0, "no cgroup2 is mounted")
        own = own_group()
        # A group with groups below it may have no processes of its own, so this one moves down.
        self._root = own / f"gym-{os.getpid()}"
        self._own, self._front = own, self._root / "front"
        try:
            self._front.mkdir(parents=True)
            add(self._front, os.getpid())
            for parent in (own, self._root):
                (parent / "cgroup.subtree_control").write_text(_CONTROLLERS)
            (self._front / "cpu.weight").write_text(str(_FRONT_WEIGHT))
        except OSError:
            self.close()
            raise

    def make(self, name: str, memory_mb: int) -> Path:
        """Make the group of a user's server, or take the one of an earlier server.

        Args:
            name: the user's name.
            memory_mb: the memory of all processes of the server, in MiB.
        """
        group = self._root / f"user-{name}"
        group.mkdir(exist_ok=True)
        (group / "memory.max").write_text(str(memory_mb * 2**20))
        (group / "pids.max").write_text(str(_MOST_TASKS))
        (group / "cpu.weight").write_text(str(_USER_WEIGHT))
        return group

    def close(self) -> None:
        """Remove the groups."""
        with contextlib.suppress(OSError):
            add(self._own, os.getpid())
        for group in (*self._root.glob("*/"), self._root):
            remove(group)


def add(group: Path, pid: int) -> None:
    """Move a process into a group; what it starts from then on is there, too."""
    (group / "cgroup.procs").write_text(str(pid))


def remove(group: Path) -> None:
    """Kill what is left in a group, and remove it."""
    # Linux 5.14 and newer. A process that is left keeps the group, which the next server takes.
    with contextlib.suppress(OSError):
        (group / "cgroup.kill").write_text("1")
    with contextlib.suppress(OSError):
        group.rmdir()
