"""The process of an isolated environment: it creates it and does what the server asks.

The process has an ordinary ``Instance`` of the environment, with a render thread and a monitor of
its own; the server has an ``IsolatedInstance``, which asks this one.
"""

from __future__ import annotations

import contextlib
import importlib
import logging
import math
import os
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from gym_server.budget import Budget
from gym_server.envs import registry
from gym_server.envs.config import EnvConfig
from gym_server.envs.memory_reservation import MemoryReservation
from gym_server.errors import GymServerError, answer_to
from gym_server.instances.factory import make_instance
from gym_server.instances.instance import Instance, Seed
from gym_server.processes import messages, start
from gym_server.processes.messages import read_call, refusal_message, value_message
from gym_server.processes.pipe import Pipe
from gym_server.processes.set_up import OWN_MB, set_up_process
from gym_server.protocol.answers import AnswerForm, Ready, response_to
from gym_server.rendering.render_thread import RenderThread

log = logging.getLogger(__name__)

# Its imports take longer than the start of a process.
start.preload(__name__)


@dataclass(frozen=True)
class WorkerSettings:
    """What a process is to know of the server.

    Attributes:
        allowed_modules: names of the modules that an env_id may import.
        imported: those that are imported before anything is created.
        max_num_envs: how many sub-environments an environment may have.
        memory: how many bytes the environment may be estimated to take; see ``memory_estimate``.
        max_mb: how much memory the process may have, in MiB; 0 for what is left for all.
        log_level: what goes to standard error.
    """

    allowed_modules: frozenset[str]
    imported: frozenset[str] = frozenset()
    max_num_envs: int = 16384
    memory: float = math.inf
    max_mb: int = 0
    log_level: int = logging.WARNING

    @property
    def most_mb(self) -> int:
        """How much memory the system lets the process have, in MiB; 0 for no limit."""
        left = int(self.memory / 2**20) + OWN_MB if math.isfinite(self.memory) else 0
        return self.max_mb or left


def serve_instance(
    calls: Connection, queries: Connection, config: EnvConfig, settings: WorkerSettings
) -> None:
    """Create an environment and serve it until it is closed.

    Where a thread of the environment's or an exit handler keeps this process from ending then,
    the server kills it.

    Args:
        calls: carries one call after the other that needs the environment's lock; the first answer
            is about its creation.
        queries: carries calls that can be answered while the environment moves.
        config: what the client wants.
        settings: what is to be known of the server.
    """
    set_up_process(settings.log_level, settings.most_mb)
    methods = _Methods(config, settings)
    pipe = Pipe(calls)
    _answer(pipe, 0, methods.create)
    if methods.is_created:
        threading.Thread(target=_serve, args=(Pipe(queries), methods), daemon=True).start()
        _serve(pipe, methods)


def list_registry(
    answers: Connection, _: Connection, search: str | None, settings: WorkerSettings
) -> None:
    """Answer what can be created with the allowed modules."""
    set_up_process(settings.log_level, settings.most_mb)
    _answer(Pipe(answers), 0, partial(registry.search, search, settings.allowed_modules))


def _serve(pipe: Pipe, methods: _Methods) -> None:
    while not methods.is_closed:
        try:
            number, method, args = read_call(pipe.receive())
        except (EOFError, OSError):
            # The server has closed its end, or is gone.
            os._exit(1)
        _answer(pipe, number, getattr(methods, method), *args)


def _answer(pipe: Pipe, number: int, call: Callable, *args: object) -> None:
    try:
        result = call(*args)
        if isinstance(result, Ready):
            message = messages.answer_message(number, result)
        elif isinstance(result, _Look):
            message = value_message(number, result.facts, result.frame)
        else:
            message = value_message(number, result)
    except BaseException as error:
        message = refusal_message(number, answer_to(error)[1])
    try:
        pipe.send(message)
    except (OSError, ValueError):
        os._exit(1)


@dataclass(frozen=True)
class _Look:
    facts: object
    frame: np.ndarray | None


class _Methods:
    """The methods that the server can call, by name."""

    _instance: Instance

    def __init__(self, config: EnvConfig, settings: WorkerSettings) -> None:
        self._config = config
        self._settings = settings
        self.is_created = False
        self.is_closed = False

    def create(self) -> dict:
        for module in self._settings.imported:
            with contextlib.suppress(Exception):
                importlib.import_module(module)
        reservation = MemoryReservation(Budget(self._settings.memory), self._config.num_envs or 1)
        with contextlib.ExitStack() as undo:
            instance = make_instance(
                self._config,
                self._settings.allowed_modules,
                self._settings.max_num_envs,
                RenderThread(),
                undo,
                reservation,
            )
            undo.pop_all()
        self._instance = instance
        self.is_created = True
        instance.report_end(_end)
        return {
            "fps": instance.viewer.fps,
            "about": instance.about(),
            "memory": reservation.taken,
        }

    # Moves and looks ------------------------------------------------------------------------

    def reset(self, seed: Seed, options: dict | None, form: tuple, mask: Any) -> Ready:
        return _ready(self._instance.reset(seed, options, AnswerForm(*form), mask))

    def step(self, action: object, form: tuple, mask: Any) -> Ready:
        before = self._instance.steps
        outcome = self._instance.step(action, AnswerForm(*form), mask)
        return _ready(outcome, self._instance.steps - before)

    def sample_action(self) -> object:
        return self._instance.sample_action()

    def render(self, sub_env: int) -> _Look:
        return _Look(None, self._instance.render(sub_env))

    def look(self, sub_env: int) -> _Look:
        return _Look(*self._instance.look(sub_env))

    def transition_model(self) -> Ready:
        return _ready(self._instance.transition_model())

    def record(self, instance_id: str, path: Path, *args: Any) -> None:
        self._instance.instance_id = instance_id
        with self._instance.lock:
            self._instance.record(path, *args)

    def close_monitor(self) -> None:
        self._instance.close_monitor()

    def close(self) -> None:
        self.is_closed = True
        self._instance.close()

    # While it moves -------------------------------------------------------------------------

    def about(self) -> dict:
        return self._instance.about()

    def space_info(self, name: str) -> dict:
        return self._instance.space_info(name)

    def contains(self, name: str, claim: dict) -> bool:
        return self._instance.contains(name, claim)


def _end(why: GymServerError) -> None:
    """End with a process of sub-environments that has ended."""
    log.warning("%s", why.message)
    os._exit(1)


def _ready(result: dict | Ready, steps: int = 0) -> Ready:
    response = response_to(result, None)
    return Ready(response.body, response.content_type, steps)
