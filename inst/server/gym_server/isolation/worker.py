"""What the process of an isolated environment does for the server.

The process has an ordinary ``Instance`` with its own render thread and monitor. The server has an
``IsolatedInstance``, which calls this one.
"""

from __future__ import annotations

import contextlib
import importlib
import logging
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gym_server.budget import Budget
from gym_server.envs import registry
from gym_server.envs.config import EnvConfig
from gym_server.envs.memory_reservation import MemoryReservation
from gym_server.errors import GymServerError
from gym_server.instances.factory import make_instance
from gym_server.instances.instance import Instance, Seed
from gym_server.processes import start
from gym_server.processes.messages import Result
from gym_server.processes.set_up import OWN_MB
from gym_server.protocol.answers import AnswerForm, Ready, response_to
from gym_server.rendering.render_thread import RenderThread

log = logging.getLogger(__name__)

# Importing it takes longer than starting a process.
start.preload(__name__)


@dataclass(frozen=True)
class WorkerSettings:
    """The server's settings for a process.

    Attributes:
        allowed_modules: the modules that an env_id may import.
        imported: those to import before the environment is created.
        max_num_envs: the largest number of sub-environments.
        memory: the largest estimate for the environment in bytes; see ``memory_estimate``.
        max_mb: the memory limit of the process in MiB; 0 for what is left for all environments.
    """

    allowed_modules: frozenset[str]
    imported: frozenset[str] = frozenset()
    max_num_envs: int = 16384
    memory: float = math.inf
    max_mb: int = 0

    @property
    def most_mb(self) -> int:
        """The memory limit that the system enforces, in MiB; 0 for no limit."""
        left = int(self.memory / 2**20) + OWN_MB if math.isfinite(self.memory) else 0
        return self.max_mb or left


_instance: Instance


def list_registry(search: str | None, settings: WorkerSettings) -> Result:
    """List the environments that can be created with the allowed modules."""
    return Result(registry.search(search, settings.allowed_modules))


def create(config: EnvConfig, settings: WorkerSettings) -> Result:
    """Create the environment that the functions below use."""
    global _instance
    for module in settings.imported:
        with contextlib.suppress(Exception):
            importlib.import_module(module)
    reservation = MemoryReservation(Budget(settings.memory), config.num_envs or 1)
    with contextlib.ExitStack() as undo:
        _instance = make_instance(
            config,
            settings.allowed_modules,
            settings.max_num_envs,
            RenderThread(),
            undo,
            reservation,
        )
        undo.pop_all()
    _instance.report_end(_exit)
    return Result(
        {"fps": _instance.viewer.fps, "about": _instance.about(), "memory": reservation.taken}
    )


def _exit(why: GymServerError) -> None:
    """Exit when a process of sub-environments has ended."""
    log.warning("%s", why.message)
    os._exit(1)


# Calls, one after the other -----------------------------------------------------------------


def reset(seed: Seed, options: dict | None, form: tuple, mask: Any) -> Ready:
    """See ``Instance.reset()``."""
    return _ready(_instance.reset(seed, options, AnswerForm(*form), mask))


def step(action: object, form: tuple, mask: Any) -> Ready:
    """See ``Instance.step()``."""
    before = _instance.steps
    outcome = _instance.step(action, AnswerForm(*form), mask)
    return _ready(outcome, _instance.steps - before)


def ask(method: str, *args: Any) -> Result:
    """Call a method of the instance that returns a JSON value; also while another call runs."""
    return Result(getattr(_instance, method)(*args))


def render(sub_env: int) -> Result:
    """See ``Instance.render()``."""
    return Result(None, _instance.render(sub_env))


def look(sub_env: int) -> Result:
    """See ``Instance.look()``."""
    return Result(*_instance.look(sub_env))


def transition_model() -> Ready:
    """See ``Instance.transition_model()``."""
    return _ready(_instance.transition_model())


def record(instance_id: str, path: Path, *args: Any) -> Result:
    """See ``Instance.record()``."""
    _instance.instance_id = instance_id
    with _instance.lock:
        _instance.record(path, *args)
    return Result(None)


def _ready(result: dict | Ready, steps: int = 0) -> Ready:
    response = response_to(result, None)
    return Ready(response.body, response.content_type, steps)
