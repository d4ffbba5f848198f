"""The pool of processes that run environments, sub-environments and whole episodes.

Starting a process takes 20 ms, and a second on Windows, so idle processes are kept here. A process
that has run environments of other packages is not kept, because they may have left anything in it.
"""

from __future__ import annotations

import threading
import time

from gym_server.processes.cores import usable_cores
from gym_server.processes.worker_process import WorkerProcess

# An idle process ends after this long.
_IDLE_SECONDS = 600.0


class Pool:
    """Keeps at most as many processes as there are cores."""

    def __init__(self, most: int | None = None) -> None:
        """Start with no processes.

        Args:
            most: how many to keep; None for one per core.
        """
        self._most = usable_cores() if most is None else most
        self._lock = threading.Lock()
        # With the time each was added; the most recent one is last.
        self._idle: list[tuple[float, WorkerProcess]] = []

    def take(self, module: str, low_priority: bool = False) -> WorkerProcess:
        """Return an unused process, and start one if necessary.

        Args:
            module: the module whose functions it runs.
            low_priority: whether it runs at a lower priority; always the same for a module.
        """
        with self._lock:
            for place in reversed(range(len(self._idle))):
                process = self._idle[place][1]
                if process.is_alive and process.module == module:
                    del self._idle[place]
                    return process
        return WorkerProcess(module, low_priority)

    def put(self, process: WorkerProcess) -> None:
        """Keep a process that has done its work, or end it if there are enough."""
        process.release()
        with self._lock:
            self._idle = [one for one in self._idle if one[1].is_alive]
            keeps = process.is_alive and len(self._idle) < self._most
            if keeps:
                self._idle.append((time.monotonic(), process))
        if not keeps:
            process.kill()

    def end_old(self) -> None:
        """End the processes that were idle for too long."""
        before = time.monotonic() - _IDLE_SECONDS
        with self._lock:
            old = [process for since, process in self._idle if since <= before]
            self._idle = [one for one in self._idle if one[0] > before]
        for process in old:
            process.kill()

    def end(self) -> None:
        """End all idle processes."""
        with self._lock:
            idle, self._idle = self._idle, []
        for _, process in idle:
            process.kill()


# The pool of this process.
pool = Pool()
