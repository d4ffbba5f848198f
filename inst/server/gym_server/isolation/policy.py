"""Which environments get a process of their own, and why not all or none.

A thread cannot be killed, and code in C that crashes, or ``os._exit``, ends its whole process. So
what is not trusted needs a process. Gymnasium's own environments and ale_py's do not do that, and
in the server's process they are faster and need no memory of their own; an environment that an
operator allowed by ``--allow-module`` may be anybody's first one. Hence "foreign". One process
for several of them would save the memory, and let the second one die with the first.

One that may take much memory at once gets a process on Linux, where the system limits what it has:
an estimate may be wrong, and to make, reset or draw such an environment, or to write what is
observed as JSON, holds the interpreter for seconds.

Measured on two noisy cores that others used, too (Python 3.11, Gymnasium 1.4, CartPole):

=====================================  ==============  =====================  ================
what                                   server process  a process by fork-     by spawn (as on
                                                       server, an instance    Windows)
=====================================  ==============  =====================  ================
to create one, ms                      2               20 (the first: 1000)   530 to 1000
memory an instance, MiB (PSS)          0.02            7.7                    29
processor time of a step by HTTP, us   202             350 (both processes)   as by forkserver
single steps a second from R           420             384 (9.6 % lost)
steps of 1,024 sub-environments a second from R   235,000         203,000 (14.5 % lost)
=====================================  ==============  =====================  ================

(Rates: medians of 60 interleaved runs of 300 and 60 calls, and of the ratios of their pairs;
six more such runs lost 24 to 40 % of the single steps and 13 to 39 % of the sub-environments'.
Waking another process takes 10 us there at best, 50 in the median and 300 in one case of ten, and a
step does so twice; with an environment that takes its time itself the share is smaller.)
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

# What one environment, or one sub-environment, may be estimated to take in the server's process:
# more than the usual ones (MuJoCo 2 MiB, pictures as observations 50). What is observed of one so
# large has a million numbers, which as JSON stop everybody for half a second.
_MOST_BYTES_HERE = 64 * 2**20


class Isolation:
    """Decides which environments get a process, and what the processes know of the server.

    Attributes:
        mode: one of ``MODES``.
    """

    def __init__(self, mode: str = "none", max_mb: int = 0) -> None:
        """Set the rule.

        Args:
            mode: one of ``MODES``.
            max_mb: how much memory a process may have, in MiB; 0 for no limit.
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
        """Tell whether an environment gets a process, without importing its module.

        Args:
            env_id: what is to be created; whatever is no id gets no process.
            allowed_modules: names of the modules that an env_id may import.
            vectorization_mode: what was asked for.
        """
        # Looking for ids that resemble a very long one would take minutes.
        if self.mode == "none" or not isinstance(env_id, str) or len(env_id) > registry.LONGEST_ID:
            return False
        module, colon, name = env_id.rpartition(":")
        if colon and module not in allowed_modules:
            return False
        home = module or _home(name, allowed_modules)
        # Making Atari's own vector environment holds the interpreter, for 88 ms a sub-environment.
        holds = vectorization_mode == "vector_entry_point" and home.startswith("ale_py")
        return self.mode == "all" or holds or (home != "" and not registry.is_known(home))

    @property
    def most_bytes_here(self) -> float:
        """How large an environment may be without a process of its own."""
        return _MOST_BYTES_HERE if self.mode == "foreign" and sys.platform == "linux" else math.inf

    def settings(
        self,
        env_id: object,
        allowed_modules: Collection[str],
        max_num_envs: int,
        memory: float = math.inf,
    ) -> WorkerSettings:
        """Return what the process of an environment is to know; see ``WorkerSettings``."""
        allowed = frozenset(allowed_modules)
        # An id from the registry's list names no module, and any of the modules may have
        # registered it.
        is_unknown = (
            isinstance(env_id, str) and ":" not in env_id and _home(env_id, allowed) is _UNKNOWN
        )
        imported = allowed if is_unknown else frozenset()
        return WorkerSettings(allowed, imported, max_num_envs, memory, self._max_mb)

    def search(
        self, text: str | None, allowed_modules: Collection[str], seconds: float
    ) -> list[dict]:
        """Return what is registered when the allowed modules are imported, elsewhere.

        Args:
            text: see ``registry.search()``.
            allowed_modules: names of the modules.
            seconds: how long that may take; 0 for as long as it takes.
        """
        try:
            # One at a time: anybody may search, and each search takes a process.
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
            # It has answered, and a thread that a module has started could keep it from ending.
            process.kill()


def _search_too_long(seconds: float) -> GymServerError:
    return call_too_long(
        "Importing the allowed modules", seconds, "what they register is not listed"
    )


_UNKNOWN = "?"


def _home(name: str, allowed_modules: Collection[str]) -> str:
    """Return the module that an id without one belongs to, "" for an id that is in error."""
    try:
        spec = registry.look_up(name)
    except (error.NameNotFound, error.NamespaceNotFound, error.VersionNotFound):
        # One of the modules may register it, and the server's process does not import them.
        return _UNKNOWN if allowed_modules else ""
    except (error.Error, GymServerError):
        return ""
    return registry.module_of(spec) or _UNKNOWN
