"""The process of an isolated environment: it makes it and does what the server asks.

The environment's own ``Instance`` lives here, with its render thread and its monitor; the server
has an ``IsolatedInstance`` in its place.
"""

from __future__ import annotations

import contextlib
import faulthandler
import importlib
import logging
import math
import os
import signal
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path

from gym_server.budget import Budget
from gym_server.envs import registry
from gym_server.envs.config import EnvConfig
from gym_server.envs.memory_reservation import MemoryReservation
from gym_server.errors import answer_to
from gym_server.instances.factory import make_instance
from gym_server.instances.instance import Instance
from gym_server.monitoring.monitor_directory import claim
from gym_server.monitoring.monitor_files import MonitorFiles
from gym_server.processes import messages, start
from gym_server.processes.messages import read_call, refusal_message, value_message
from gym_server.processes.pipe import Pipe
from gym_server.protocol import answers
from gym_server.rendering.render_thread import RenderThread

# Its imports take longer than the start of a process.
start.preload(__name__)


@dataclass(frozen=True)
class Surroundings:
    """What a process is told at its start.

    Attributes:
        allowed_modules: names of the modules that an env_id may import.
        imported: those that are imported before anything is made.
        max_num_envs: how many sub-environments an environment may have.
        memory: how many bytes it may be estimated to take; see ``memory_estimate``.
        max_mb: how much memory the process may have, in MiB; 0 for no limit.
        log_level: what goes to standard error.
    """

    allowed_modules: frozenset[str]
    imported: frozenset[str] = frozenset()
    max_num_envs: int = 16384
    memory: float = math.inf
    max_mb: int = 0
    log_level: int = logging.WARNING


def keep_instance(
    moves: Connection, questions: Connection, choices: EnvConfig, surroundings: Surroundings
) -> None:
    """Make an environment and serve it until it is closed.

    What keeps this process from its end then, a thread of the environment's or an exit handler,
    is ended by the server.

    Args:
        moves: asks for one move or look after the other; the first answer is how it was made.
        questions: asks what can be said while it moves.
        choices: what the client wants.
        surroundings: what is to be known of the server.
    """
    _settle(surroundings)
    asked = _Asked(choices, surroundings)
    channel = Pipe(moves)
    _answer(channel, 0, asked.make)
    if asked.instance is not None:
        threading.Thread(target=_serve, args=(Pipe(questions), asked), daemon=True).start()
        _serve(channel, asked)


def list_registry(
    answers: Connection, _: Connection, search: str | None, surroundings: Surroundings
) -> None:
    """Answer what can be created with the allowed modules."""
    _settle(surroundings)
    _answer(Pipe(answers), 0, partial(registry.search, search, surroundings.allowed_modules))


def _settle(surroundings: Surroundings) -> None:
    """Become a process that ends with the server, and when the server says so."""
    if hasattr(os, "setsid"):
        # What the environment starts can be ended with it, and Ctrl-C is the server's affair.
        os.setsid()
    for name in ("SIGINT", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    start.exit_with_parent(group=True)
    logging.basicConfig(
        level=surroundings.log_level,
        stream=sys.stderr,
        format="%(asctime)s %(levelname)s %(name)s (process %(process)d): %(message)s",
    )
    logging.captureWarnings(True)
    with contextlib.suppress(OSError, ValueError, AttributeError):
        # A crash in C says where it was.
        faulthandler.enable()
    if surroundings.max_mb:
        _limit_memory(surroundings.max_mb * 2**20)


def _limit_memory(size: int) -> None:
    # Not RLIMIT_AS: threads and libraries reserve addresses that they never use.
    import resource

    resource.setrlimit(resource.RLIMIT_DATA, (size, size))


def _serve(channel: Pipe, asked: _Asked) -> None:
    while not asked.is_closed:
        try:
            number, method, args = read_call(channel.receive())
        except (EOFError, OSError):
            # The server let go of it, or is gone.
            os._exit(1)
        _answer(channel, number, getattr(asked, method), *args)


def _answer(channel: Pipe, number: int, call: Callable, *args: object) -> None:
    try:
        result = call(*args)
        if isinstance(result, answers.Answer):
            message = messages.answer_message(number, result)
        elif isinstance(result, _Look):
            message = value_message(number, result.facts, result.frame)
        else:
            message = value_message(number, result)
    except BaseException as error:
        message = refusal_message(number, answer_to(error)[1])
    try:
        channel.send(message)
    except (OSError, ValueError):
        os._exit(1)


@dataclass(frozen=True)
class _Look:
    facts: object
    frame: object


class _Asked:
    """What the server can ask for, by name."""

    def __init__(self, choices: EnvConfig, surroundings: Surroundings) -> None:
        self._choices = choices
        self._surroundings = surroundings
        self.instance: Instance | None = None
        self.is_closed = False

    def make(self) -> dict:
        for module in self._surroundings.imported:
            with contextlib.suppress(Exception):
                importlib.import_module(module)
        account = MemoryReservation(Budget(self._surroundings.memory), self._choices.num_envs or 1)
        with contextlib.ExitStack() as undo:
            instance = make_instance(
                self._choices,
                self._surroundings.allowed_modules,
                self._surroundings.max_num_envs,
                RenderThread(),
                undo,
                account,
            )
            undo.pop_all()
        self.instance = instance
        return {
            "fps": instance.screen.fps,
            "about": instance.about(),
            "memory": account.taken,
        }

    # Moves and looks ------------------------------------------------------------------------

    def reset(self, *args: object) -> answers.Answer:
        return answers.answer(self.instance.reset(*args), None)

    def step(self, *args: object) -> answers.Answer:
        return answers.answer(self.instance.step(*args), None)

    def sample_action(self) -> object:
        return self.instance.sample_action()

    def render(self, sub_env: int) -> _Look:
        return _Look(None, self.instance.render(sub_env))

    def look(self, sub_env: int) -> _Look:
        return _Look(*self.instance.look(sub_env))

    def start_monitor(self, instance_id: str, path: Path, *args: object) -> None:
        self.instance.instance_id = instance_id
        self.instance.start_monitor(_Resolved(path), *args)

    def close_monitor(self) -> None:
        self.instance.close_monitor()

    def close(self) -> None:
        self.is_closed = True
        self.instance.close()

    # While it moves -------------------------------------------------------------------------

    def about(self) -> dict:
        return self.instance.about()

    def action_space_info(self) -> dict:
        return self.instance.action_space_info

    def observation_space_info(self) -> dict:
        return self.instance.observation_space_info

    def action_contains(self, claim: dict) -> bool:
        return self.instance.action_contains(claim)

    def observation_contains(self, claim: dict) -> bool:
        return self.instance.observation_contains(claim)


class _Resolved:
    """Stands for the server's ``MonitorRoot``, which has allowed the directory already."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def claim(self, directory: str, *how: object) -> MonitorFiles:
        return claim(self._path, directory, *how)
