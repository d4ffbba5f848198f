"""Kill processes that hang, end unused instances and processes, and return free memory.

The watchdog has its own thread, so that checking slows no call.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from gym_server import memory
from gym_server.manager.instance_manager import InstanceManager
from gym_server.manager.limits import Limits
from gym_server.manager.rollouts import Rollouts
from gym_server.processes.pool import pool
from gym_server.processes.worker_process import kill_overdue

log = logging.getLogger(__name__)

# The longest time between two checks; with short limits it is shorter.
_LONGEST_TICK = 1.0
_SHARE_OF_LIMIT = 0.1

# How often memory is returned to the system, which takes some milliseconds, and with many thousands
# of sub-environments some tenths of a second.
_GIVE_BACK_SECONDS = 30.0


class Watchdog:
    """Enforces the limits of time, and returns free memory."""

    def __init__(
        self,
        instances: InstanceManager,
        rollouts: Rollouts,
        limits: Limits,
        end_unused: Callable[[], None],
    ) -> None:
        """Start to watch.

        Args:
            instances: the instances to watch.
            rollouts: the rollouts to watch.
            limits: the limits.
            end_unused: is called when there has been neither an instance nor a rollout for as long
                as an instance may be unused.
        """
        self._instances = instances
        self._rollouts = rollouts
        self._limits = limits
        self._end_unused = end_unused
        self._used = self._gave_back = time.monotonic()
        self._stopped = threading.Event()
        thread = threading.Thread(target=self._run, name="watchdog", daemon=True)
        thread.start()

    def stop(self) -> None:
        """Stop watching."""
        self._stopped.set()

    def _run(self) -> None:
        limits = (self._limits.max_call_seconds, self._limits.idle_minutes * 60)
        tick = min([_LONGEST_TICK, *(_SHARE_OF_LIMIT * limit for limit in limits if limit)])
        while not self._stopped.wait(tick):
            try:
                self._check()
            except Exception:
                log.exception("A bug in the server")

    def _check(self) -> None:
        if self._limits.max_call_seconds:
            kill_overdue(self._limits.max_call_seconds)
        self._rollouts.kill_unwanted()
        pool.end_old()
        if self._limits.idle_minutes:
            self._instances.evict_idle(self._limits.idle_minutes)
            if self._instances.env_ids() or self._rollouts.is_at_work:
                self._used = time.monotonic()
            elif time.monotonic() > self._used + 60 * self._limits.idle_minutes:
                self._end_unused()
        if time.monotonic() > self._gave_back + _GIVE_BACK_SECONDS:
            garbage, self._instances.left_garbage = self._instances.left_garbage, False
            memory.give_back(garbage)
            self._gave_back = time.monotonic()
