"""Run an environment in its own process."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, cast

from gym_server.envs.config import EnvConfig
from gym_server.envs.memory_reservation import MemoryReservation
from gym_server.errors import GymServerError
from gym_server.instances.instance import Instance, Seed
from gym_server.isolation import worker
from gym_server.isolation.worker import WorkerSettings
from gym_server.processes.messages import Result
from gym_server.processes.pool import pool
from gym_server.protocol.answers import AnswerForm, Ready
from gym_server.protocol.safetensors import Tensor
from gym_server.rendering.render_thread import RenderThread
from gym_server.spaces import Parts
from gym_server.viewing.viewer import usable_fps

if TYPE_CHECKING:
    import numpy as np

log = logging.getLogger(__name__)

# An environment may block all threads of its process. After this long, the last known answer is
# used.
_ABOUT_SECONDS = 1.0


class IsolatedInstance(Instance):
    """Runs an environment in its own process.

    The process has an ordinary ``Instance``, which does everything except the lock, the watchers
    and their pace: this instance has those. If the process ends unexpectedly, every call raises
    ``environment_died``.
    """

    # Its frames are drawn in its own process.
    draws_when_stepped = False
    draws_on_render_thread = False
    can_be_killed = True

    def __init__(self, config: EnvConfig, settings: WorkerSettings, renderer: RenderThread) -> None:
        """Take a process; ``create()`` creates the environment there.

        Args:
            config: what the client chose.
            settings: the server's settings for the process.
            renderer: the server's render thread.
        """
        super().__init__(config, renderer)
        self.env_id = str(config.env_id)
        self._last_about: dict = {}
        self._create_args = config, settings
        hint = f"the server's option --max-worker-mb limits it to {settings.max_mb} MiB"
        self._process = pool.take(
            worker.__name__,
            trusted=False,
            most_mb=settings.most_mb,
            hint=hint if settings.max_mb else None,
        )

    def create(self, reservation: MemoryReservation) -> None:
        """Create the environment.

        Args:
            reservation: reserves the memory that its process reports.

        Raises:
            GymServerError: see ``factory.make_instance()``; ``environment_died``.
        """
        created = _dict(self._process.call("create", *self._create_args))
        self._last_about = created["about"]
        reservation.take(max(0.0, float(created["memory"])), self.env_id)
        self.env_id = str(self._last_about["env_id"])
        self.viewer.fps = usable_fps(created["fps"])

    def _report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        self._process.report_end(on_end)

    # Resets and steps -----------------------------------------------------------------------

    def _reset(
        self, seed: Seed, options: dict | None, form: AnswerForm, mask: np.ndarray | None
    ) -> Ready:
        return self._begin("reset", seed, options, tuple(form), mask)

    def _step(self, action: object, form: AnswerForm, mask: np.ndarray | None) -> Ready:
        if isinstance(action, Parts):
            action = _sendable(action)
        answer = self._begin("step", action, tuple(form), mask)
        self.steps += answer.steps
        return answer

    # The form is sent as a plain tuple: pickling and unpickling a class takes 8 us longer.
    def _begin(self, method: str, *args: object) -> Ready:
        self.begin_reset_or_step()
        return cast(Ready, self._process.call(method, *args))

    def _ask(self, method: str, *args: object) -> object:
        return self._process.call("ask", method, *args).value

    def _sample_action(self) -> object:
        return self._ask("sample_action")

    # Looks ----------------------------------------------------------------------------------

    def _render(self, sub_env: int) -> np.ndarray:
        return cast("np.ndarray", self._process.call("render", sub_env).frame)

    def look(self, sub_env: int) -> tuple[dict, np.ndarray | None]:
        """Return what a watcher sees of a sub-environment; see ``Watchable.look()``."""
        result = self._process.call("look", sub_env)
        return dict(_dict(result)), result.frame

    def _transition_model(self) -> Ready:
        return cast(Ready, self._process.call("transition_model"))

    # At any time ----------------------------------------------------------------------------

    def space_info(self, name: str) -> dict:
        """Return the description of a space."""
        return _dict(self._process.query("ask", "space_info", name))

    def contains(self, name: str, claim: dict) -> bool:
        """Answer a client's "contains" question."""
        return bool(self._process.query("ask", "contains", name, claim).value)

    def _about(self) -> dict:
        try:
            self._last_about = _dict(self._process.query("ask", "about", timeout=_ABOUT_SECONDS))
        except TimeoutError:
            log.info("The process of %s does not answer at the moment", self.env_id)
        return {**self._last_about, "isolated": True}

    @property
    def pids(self) -> list[int]:
        """Its process."""
        return [self._process.pid]

    @property
    def query_since(self) -> float | None:
        """When the current query to the process started, in the clock's seconds, or None."""
        return self._process.query_since

    # Monitors -------------------------------------------------------------------------------

    def record(
        self, path: Path, directory: str, force: bool, resume: bool, video_every: int
    ) -> None:
        """Record the episodes that start from now on; see ``Instance.record()``."""
        how = (directory, force, resume, video_every)
        self._process.call("record", self.instance_id, path, *how)

    def _close_monitor(self) -> None:
        self._ask("close_monitor")

    # The end --------------------------------------------------------------------------------

    def _close(self, why: GymServerError) -> None:
        self._process.release()
        try:
            self._ask("close")
        finally:
            self._process.end(why)

    def kill(self, why: GymServerError) -> None:
        """Kill the process; every call on it raises the reason, so none is stuck."""
        self._process.kill(why)

    def _close_abandoned(self) -> None:
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
