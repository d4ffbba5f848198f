"""Runs an environment in a process of its own."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TYPE_CHECKING, cast

from gym_server.envs.config import EnvConfig
from gym_server.envs.memory_reservation import MemoryReservation
from gym_server.errors import GymServerError
from gym_server.instances.backend import Seed
from gym_server.isolation.worker import WorkerSettings, serve_instance
from gym_server.monitoring.monitor_directory import MonitorRoot
from gym_server.processes.messages import Result
from gym_server.processes.worker_process import WorkerProcess
from gym_server.protocol.answers import AnswerForm, Ready
from gym_server.protocol.safetensors import Tensor
from gym_server.spaces import Parts
from gym_server.viewing.watchable import Moves

if TYPE_CHECKING:
    import numpy as np

log = logging.getLogger(__name__)

# An environment that lets no other thread of its process run cannot answer; after this long the
# last known answer is given.
_ABOUT_SECONDS = 1.0


class WorkerBackend:
    """Runs an environment in a process of its own; see ``Backend`` for the methods.

    The process has an ordinary ``Instance``, which is asked for everything but the lock, the
    watchers and their pace: those are with the instance here. When the process ends by itself,
    every call raises ``environment_died``.
    """

    # Its frames are drawn in its own process.
    draws_when_stepped = False
    draws_on_render_thread = False
    can_be_killed = True
    grown = 0

    def __init__(self, config: EnvConfig, settings: WorkerSettings) -> None:
        """Start the process; ``create()`` waits for the environment.

        Args:
            config: what the client wants.
            settings: what the process is to know of the server.
        """
        self.env_id = str(config.env_id)
        self.fps: object = None
        self.moves = Moves()
        self.steps = 0
        self._about: dict = {}
        self._on_end: Callable[[GymServerError], None] = lambda why: None
        hint = (
            f"the server's option --max-worker-mb lets it have {settings.max_mb} MiB"
            if settings.max_mb
            else ""
        )
        self._worker = WorkerProcess(
            serve_instance,
            config,
            settings,
            on_end=lambda why: self._on_end(why),
            hint=hint,
            first_result=True,
        )

    def create(self, reservation: MemoryReservation) -> None:
        """Wait until the environment is created.

        Args:
            reservation: what its memory is charged to, as far as its process reports it.

        Raises:
            GymServerError: see ``factory.make_instance()``; ``environment_died``.
        """
        created = _dict(self._worker.first_result())
        self._about = created["about"]
        reservation.take(max(0.0, float(created["memory"])), self.env_id)
        self.env_id = str(self._about["env_id"])
        self.fps = created["fps"]

    def report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        """From now on report when the process ends by itself, or at once if it has."""
        self._on_end = on_end
        self._worker.report_end()

    # Moves ----------------------------------------------------------------------------------

    def reset(
        self, seed: Seed, options: dict | None, form: AnswerForm, mask: np.ndarray | None
    ) -> Ready:
        """Start an episode; see ``Instance.reset()``."""
        return self._move("reset", seed, options, tuple(form), mask)

    def step(self, action: object, form: AnswerForm, mask: np.ndarray | None) -> Ready:
        """Take one step; see ``Instance.step()``."""
        if isinstance(action, Parts):
            action = _sendable(action)
        answer = self._move("step", action, tuple(form), mask)
        self.steps += answer.steps
        return answer

    # The form goes as a plain tuple: to pickle and to read a class takes 8 us longer.
    def _move(self, method: str, *args: object) -> Ready:
        self.moves.begin()
        return cast(Ready, self._worker.call(method, *args))

    def _ask(self, method: str, *args: object) -> Result:
        return cast(Result, self._worker.call(method, *args))

    def sample_action(self) -> object:
        """Draw an action from the action space's own generator."""
        return self._ask("sample_action").value

    # Looks ----------------------------------------------------------------------------------

    def render(self, sub_env: int) -> np.ndarray:
        """Draw the current state of a sub-environment; see ``Instance.render()``."""
        return cast("np.ndarray", self._ask("render", sub_env).frame)

    def look(self, sub_env: int) -> tuple[dict, np.ndarray | None]:
        """Return what a watcher sees of a sub-environment; see ``Watchable.look()``."""
        result = self._ask("look", sub_env)
        return dict(_dict(result)), result.frame

    def transition_model(self) -> Ready:
        """Tell how the environment moves; see ``Instance.transition_model()``."""
        return cast(Ready, self._worker.call("transition_model"))

    # At any time ----------------------------------------------------------------------------

    @property
    def action_space_info(self) -> dict:
        """The description of the action space."""
        return _dict(self._worker.query("action_space_info"))

    @property
    def observation_space_info(self) -> dict:
        """The description of the observation space."""
        return _dict(self._worker.query("observation_space_info"))

    def action_contains(self, claim: dict) -> bool:
        """Answer a client's "contains"; see ``spaces.contains()``."""
        return bool(self._worker.query("action_contains", claim).value)

    def observation_contains(self, claim: dict) -> bool:
        """Answer a client's "contains"; see ``spaces.contains()``."""
        return bool(self._worker.query("observation_contains", claim).value)

    def about(self) -> dict:
        """Return what is known of the environment, without waiting for it."""
        try:
            self._about = _dict(self._worker.query("about", timeout=_ABOUT_SECONDS))
        except TimeoutError:
            log.info("The process of %s does not answer at the moment", self.env_id)
        return {**self._about, "isolated": True}

    @property
    def pids(self) -> list[int]:
        """Its process."""
        return [self._worker.pid]

    @property
    def busy_since(self) -> float | None:
        """Since when a query has waited for the process, in the clock's seconds, or None."""
        return self._worker.query_since

    # Monitors -------------------------------------------------------------------------------

    def start_monitor(
        self, instance_id: str, root: MonitorRoot, directory: str, *how: bool | int
    ) -> None:
        """Record the episodes that start from now on; see ``Monitor``."""
        path = root.resolve(directory)
        self._ask("start_monitor", instance_id, path, directory, *how)

    def close_monitor(self) -> None:
        """Stop recording and finish the files, if it is recorded."""
        self._ask("close_monitor")

    # The end --------------------------------------------------------------------------------

    def close(self, why: GymServerError) -> None:
        """Finish the monitor, close the environment and let its process end."""
        self._worker.begin_close()
        try:
            self._ask("close")
        finally:
            self._worker.close(why)

    def kill(self, why: GymServerError) -> None:
        """Kill the process; every call on it raises the reason, so none is stuck."""
        self._worker.kill(why)

    def close_abandoned(self) -> None:
        """Do nothing: the process was killed."""


def _dict(result: Result) -> dict:
    return cast(dict, result.value)


def _sendable(action: Parts) -> Parts:
    """Return tensors whose bytes can be pickled."""
    tensors = {
        name: Tensor(tensor.dtype, tensor.shape, bytes(tensor.data))
        for name, tensor in action.tensors.items()
    }
    return Parts(tensors, action.texts)
