"""The pool of all processes that run environments, sub-environments and whole episodes.

To start a process takes 20 ms, and a second on Windows, so they wait here for the next ones. One
that has run environments of foreign packages is not kept: who knows what they have left in it. Nor
is one that has become large.
"""

from __future__ import annotations

import threading
import time

from gym_server.processes.cores import usable_cores
from gym_server.processes.memory import bytes_of
from gym_server.processes.worker_process import WorkerProcess

# What has drawn with MuJoCo keeps 110 MiB.
_MOST_BYTES = 128 * 2**20

# After so many seconds without work a process ends.
_IDLE_SECONDS = 600.0


class Pool:
    """Keeps at most as many processes as there are cores.

    Attributes:
        most_mb: how much memory the system lets a process have, in MiB; 0 for no limit.
    """

    def __init__(self, most: int | None = None, idle_seconds: float = _IDLE_SECONDS) -> None:
        """Start with none.

        Args:
            most: how many to keep; None for one a core.
            idle_seconds: how long to keep one.
        """
        self.most_mb = 0
        self._most = usable_cores() if most is None else most
        self._idle_seconds = idle_seconds
        self._lock = threading.Lock()
        # With the time at which each was put here, the last one last.
        self._idle: list[tuple[float, WorkerProcess]] = []
        self._timer: threading.Timer | None = None

    def take(
        self,
        module: str,
        polite: bool = False,
        trusted: bool = True,
        most_mb: int = 0,
        hint: str | None = None,
    ) -> WorkerProcess:
        """Return a process that nobody uses, started if need be.

        Args:
            module: the name of the module whose functions it is to run.
            polite: whether it gives way to other processes from now on, also those that use it
                later; ordinary ones are given to those who did not ask for that.
            trusted: see ``WorkerProcess``; one that is not is always a new one, and must not be put
                here.
            most_mb: how much memory the system lets a new one have, in MiB; 0 for the pool's limit.
            hint: what to do about an end by itself of a new one.
        """
        idle = self._take_idle(polite) if trusted else None
        process = idle or WorkerProcess(most_mb or self.most_mb, trusted, hint)
        process.module = module
        if polite:
            process.give_way()
        return process

    def _take_idle(self, polite: bool) -> WorkerProcess | None:
        with self._lock:
            for place in reversed(range(len(self._idle))):
                process = self._idle[place][1]
                if process.is_alive and (polite or not process.gives_way):
                    del self._idle[place]
                    return process
        return None

    def put(self, process: WorkerProcess) -> None:
        """Keep a process whose work is done, or end it if there are enough."""
        process.release()
        is_small = bytes_of(process.pid, exactly=True) <= _MOST_BYTES
        with self._lock:
            self._idle = [one for one in self._idle if one[1].is_alive]
            keeps = process.is_alive and is_small and len(self._idle) < self._most
            if keeps:
                self._idle.append((time.monotonic(), process))
            if keeps and self._timer is None:
                self._start_timer()
        if not keeps:
            process.kill()

    def _start_timer(self) -> None:
        oldest, _ = self._idle[0]
        left = oldest + self._idle_seconds - time.monotonic()
        self._timer = threading.Timer(max(0.0, left), self._end_old)
        self._timer.daemon = True
        self._timer.start()

    def _end_old(self) -> None:
        before = time.monotonic() - self._idle_seconds
        with self._lock:
            old = [process for since, process in self._idle if since <= before]
            self._idle = [one for one in self._idle if one[0] > before]
            self._timer = None
            if self._idle:
                self._start_timer()
        for process in old:
            process.kill()

    def end(self) -> None:
        """End all processes that wait here."""
        with self._lock:
            idle, self._idle = self._idle, []
        for _, process in idle:
            process.kill()


# That of this process.
pool = Pool()
