"""Decide which environments get their own process, and why not all or none.

A thread cannot be killed, and C code that crashes, or ``os._exit()``, ends its whole process. So
environments that are not trusted need a process. Gymnasium's own environments and ale_py's do
neither, and in the server's process they are faster and need less memory. An environment that an
operator allowed by ``--allow-module`` may be somebody's first attempt. Hence the mode "foreign".
One process for several of these would save memory, but if one died the others would, too.

On Linux, where the system can limit its memory, an environment that may suddenly take much memory
gets a process, too: an estimate may be wrong, and making, resetting or drawing such an environment,
or writing its observations as JSON, holds the GIL for seconds.

Measured on two noisy cores that others used, too (Python 3.11, Gymnasium 1.4, CartPole):

=====================================  ==============  =====================  ================
what                                   server process  a process by fork-     by spawn (as on
                                                       server, an instance    Windows)
=====================================  ==============  =====================  ================
creation, ms                           2               20 (the first: 1000)   530 to 1000
memory per instance, MiB (PSS)         0.02            7.7                    29
processor time of a step by HTTP, us   202             350 (both processes)   as by forkserver
single steps a second from R           420             384 (9.6 % lost)
steps of 1,024 sub-environments a second from R   235,000         203,000 (14.5 % lost)
=====================================  ==============  =====================  ================

(Rates: medians of 60 interleaved runs of 300 and 60 calls, and of the ratios of their pairs. In six
more such runs, single steps lost 24 to 40 % and those of sub-environments 13 to 39 %. Waking
another process takes 10 us at best, 50 in the median and 300 in one case of ten. A step does it
twice. With a slower environment the loss is smaller.)
"""

from __future__ import annotations

import logging
import math
import sys
import threading
from collections.abc import Collection
from typing import cast

from gymnasium import error

from gym_server.envs import registry
from gym_server.errors import GymServerError, call_too_long
from gym_server.isolation import worker
from gym_server.isolation.worker import WorkerSettings
from gym_server.processes.pool import pool

log = logging.getLogger(__name__)

MODES = ("none", "foreign", "all")

# The largest estimate for one environment, or sub-environment, in the server's process: more than
# the usual ones (MuJoCo 2 MiB, pictures as observations 50). Observations this large have a million
# numbers, and writing them as JSON blocks all calls for half a second.
_MOST_BYTES_HERE = 64 * 2**20


class Isolation:
    """Decides which environments get a process, and which settings the processes get.

    Attributes:
        mode: one of ``MODES``.
    """

    def __init__(self, mode: str = "none", max_mb: int = 0) -> None:
        """Set the rule.

        Args:
            mode: one of ``MODES``.
            max_mb: the memory limit of a process in MiB; 0 for no limit.
        """
        self.mode = mode
        self._max_mb = max_mb
        self._searching = threading.Lock()

    def wants(
        self,
        env_id: object,
        allowed_modules: Collection[str],
        vectorization_mode: str | None = None,
    ) -> bool:
        """Return whether an environment gets a process, without importing its module.

        Args:
            env_id: the id of the environment; invalid ids get no process.
            allowed_modules: the modules that an env_id may import.
            vectorization_mode: the requested mode.
        """
        # Finding ids similar to a very long one would take minutes.
        if self.mode == "none" or not isinstance(env_id, str) or len(env_id) > registry.LONGEST_ID:
            return False
        module, colon, name = env_id.rpartition(":")
        if colon and module not in allowed_modules:
            return False
        home = module or _home(name, allowed_modules)
        # Making Atari's own vector environment holds the GIL for 88 ms per sub-environment.
        holds = vectorization_mode == "vector_entry_point" and home.startswith("ale_py")
        return self.mode == "all" or holds or (home != "" and not registry.is_known(home))

    @property
    def most_bytes_here(self) -> float:
        """The largest estimate for an environment without its own process, in bytes."""
        return _MOST_BYTES_HERE if self.mode == "foreign" and sys.platform == "linux" else math.inf

    def settings(
        self,
        env_id: object,
        allowed_modules: Collection[str],
        max_num_envs: int,
        memory: float = math.inf,
    ) -> WorkerSettings:
        """Return the settings for an environment's process."""
        allowed = frozenset(allowed_modules)
        # An id from the list of the registry has no module; any allowed module may have registered
        # it.
        is_unknown = (
            isinstance(env_id, str) and ":" not in env_id and _home(env_id, allowed) is _UNKNOWN
        )
        imported = allowed if is_unknown else frozenset()
        return WorkerSettings(allowed, imported, max_num_envs, memory, self._max_mb)

    def search(
        self, text: str | None, allowed_modules: Collection[str], seconds: float
    ) -> list[dict]:
        """List the registered environments in a process that imports the allowed modules.

        Args:
            text: see ``registry.search()``.
            allowed_modules: the modules.
            seconds: the time limit; 0 for no limit.
        """
        try:
            # One at a time: anybody may search, and each search needs a process.
            if not self._searching.acquire(timeout=seconds or -1):
                raise _search_too_long(seconds)
            try:
                return self._search(text, allowed_modules, seconds)
            finally:
                self._searching.release()
        except GymServerError as failure:
            log.warning("The allowed modules cannot be listed: %s", failure)
            return registry.search(text, ())

    def _search(
        self, text: str | None, allowed_modules: Collection[str], seconds: float
    ) -> list[dict]:
        settings = self.settings(None, allowed_modules, 0)
        process = pool.take(worker.__name__, trusted=False, most_mb=settings.most_mb)
        overdue = threading.Timer(seconds, process.kill, (_search_too_long(seconds),))
        overdue.daemon = True
        if seconds:
            overdue.start()
        try:
            return cast(list[dict], process.call("list_registry", text, settings).value)
        finally:
            overdue.cancel()
            # A thread started by a module could keep the process from exiting.
            process.kill()


def _search_too_long(seconds: float) -> GymServerError:
    return call_too_long(
        "Importing the allowed modules", seconds, "what they register is not listed"
    )


_UNKNOWN = "?"


def _home(name: str, allowed_modules: Collection[str]) -> str:
    """Return the module of an id without one; "" for an invalid id."""
    try:
        spec = registry.look_up(name)
    except (error.NameNotFound, error.NamespaceNotFound, error.VersionNotFound):
        # An allowed module may register it, but the server's process does not import these.
        return _UNKNOWN if allowed_modules else ""
    except (error.Error, GymServerError):
        return ""
    return registry.module_of(spec) or _UNKNOWN
