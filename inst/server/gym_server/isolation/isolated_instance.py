"""Stands for an instance that lives in a process of its own."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

import numpy as np

from gym_server.envs.config import EnvConfig
from gym_server.envs.memory_reservation import MemoryReservation
from gym_server.errors import GymServerError
from gym_server.instances.listed import Listed
from gym_server.instances.lock import Hold
from gym_server.isolation.worker import Surroundings, keep_instance
from gym_server.monitoring.monitor_directory import MonitorRoot
from gym_server.processes.messages import Result
from gym_server.processes.worker_process import WorkerProcess
from gym_server.protocol.answers import Ready
from gym_server.protocol.safetensors import Tensor
from gym_server.spaces import Parts
from gym_server.viewing.viewer import Screen

# What an environment is asked that keeps its process from any word: what is known is told.
_ABOUT_SECONDS = 1.0


class IsolatedInstance(Listed):
    """One environment in a process of its own, with the methods of ``Instance``.

    The order of moves, the watchers and their pace are kept here, as for an environment in the
    server's process; everything else is asked of the process, and when that ends by itself,
    every call raises ``environment_died``.
    """

    # Its pictures are drawn in its own process.
    draws_when_stepped = False

    def __init__(
        self,
        choices: EnvConfig,
        surroundings: Surroundings,
        on_end: Callable[[IsolatedInstance, GymServerError], None],
    ) -> None:
        """Start the process; ``create()`` waits for the environment.

        Args:
            choices: what the client wants.
            surroundings: what the process is to know of the server.
            on_end: called with this and the reason when the process has ended by itself.
        """
        self.env_id = str(choices.env_id)
        self._choices = choices
        self._on_end = on_end
        self.hold = Hold(self)  # type: ignore[arg-type]
        self.screen = Screen(self, None)  # type: ignore[arg-type]
        self._for_eyes = choices.render_mode == "human"
        self._made = time.monotonic()
        self._num_envs = choices.num_envs
        self._steps = 0
        self._about: dict = {}
        hint = (
            f"the server's option --max-worker-mb lets it have {surroundings.max_mb} MiB"
            if surroundings.max_mb
            else ""
        )
        self._worker = WorkerProcess(
            keep_instance, choices, surroundings, on_end=self._end, hint=hint
        )

    def create(self, account: MemoryReservation) -> None:
        """Wait until the environment is made.

        Args:
            account: what its memory is charged to, as far as its process tells it.

        Raises:
            GymServerError: see ``factory.make_instance()``; ``environment_died``.
        """
        made = self._value(self._worker.first_result())
        self._about = made["about"]
        account.take(max(0.0, float(made["memory"])), self.env_id)
        self.env_id = str(self._about["env_id"])
        self._sub_envs = int(self._about["num_envs"] or 1)
        self.screen = Screen(self, made["fps"])  # type: ignore[arg-type]
        self._made = self.hold.used = time.monotonic()

    def stay(self) -> None:
        """Hear that it is on the list, which it leaves when its process ends."""
        self._worker.report_end()

    @staticmethod
    def _value(seen: Result) -> dict:
        return seen.value  # type: ignore[return-value]

    # Moves ----------------------------------------------------------------------------------

    def reset(
        self,
        seed: int | tuple[int | None, ...] | None,
        options: dict | None,
        tensors: bool = False,
        mask: np.ndarray | None = None,
    ) -> Ready:
        """Start an episode; see ``Instance.reset()`` and ``VectorInstance.reset()``."""
        if self._for_eyes:
            self.screen.pace()
        with self.hold:
            return self._move("reset", seed, options, tensors, mask)

    def step(
        self,
        action: object,
        tensors: bool = False,
        mask: np.ndarray | None = None,
        for_eyes: bool = False,
    ) -> Ready:
        """Take one step; see ``Instance.step()`` and ``VectorInstance.step()``."""
        if for_eyes or self._for_eyes:
            self.screen.pace()
        if isinstance(action, Parts):
            action = _sendable(action)
        with self.hold:
            answer = self._move("step", action, tensors, mask)
            self._steps += self._sub_envs if mask is None else int(mask.sum())
            return answer

    def _move(self, method: str, *args: object) -> Ready:
        self._tell_of_move()
        return self._worker.call(method, *args)

    def sample_action(self) -> object:
        """Draw an action from the action space's own generator."""
        with self.hold:
            return self._worker.call("sample_action").value

    # Looks ----------------------------------------------------------------------------------

    def render(self, sub_env: int = 0) -> np.ndarray:
        """Draw the current state of a sub-environment; see ``Instance.render()``."""
        self.check_sub_env(sub_env)
        with self.hold:
            return self._worker.call("render", sub_env).frame

    def draws_on_render_thread(self) -> bool:
        """Tell whether a picture takes the server's render thread."""
        return False

    def look(self, sub_env: int) -> tuple[dict, np.ndarray | None]:
        """Return what a watcher sees of a sub-environment; whoever calls it has the hold."""
        seen = self._worker.call("look", sub_env)
        return dict(self._value(seen)), seen.frame

    # While it moves -------------------------------------------------------------------------

    @property
    def action_space_info(self) -> dict:
        """The description of the action space."""
        return self._value(self._worker.query("action_space_info"))

    @property
    def observation_space_info(self) -> dict:
        """The description of the observation space."""
        return self._value(self._worker.query("observation_space_info"))

    def action_contains(self, claim: dict) -> bool:
        """Answer a client's "contains"; see ``spaces.contains()``."""
        return bool(self._worker.query("action_contains", claim).value)

    def observation_contains(self, claim: dict) -> bool:
        """Answer a client's "contains"; see ``spaces.contains()``."""
        return bool(self._worker.query("observation_contains", claim).value)

    def about(self) -> dict:
        """Return all that is known of the instance, without waiting for its environment."""
        try:
            self._about = self._value(self._worker.query("about", timeout=_ABOUT_SECONDS))
        except TimeoutError:
            logging.getLogger(__name__).info("Instance %s says nothing now", self.instance_id)
        return {**self._about, **self.line(), "isolated": True}

    @property
    def busy_since(self) -> float | None:
        """Since when a call has waited for it; also one that asks what can be said meanwhile."""
        since = (self.hold.busy_since, self._worker.query_since)
        return min((one for one in since if one is not None), default=None)

    # Monitors -------------------------------------------------------------------------------

    def start_monitor(self, root: MonitorRoot, directory: str, *how: object) -> None:
        """Record the episodes that start from now on; see ``Monitor``."""
        with self.hold:
            # Sub-environments are refused by the process, which says why.
            path = None if self._num_envs is not None else root.resolve(directory)
            self._worker.call("start_monitor", self.instance_id, path, directory, *how)

    def close_monitor(self) -> None:
        """Stop recording and finish the files; see ``Instance.close_monitor()``."""
        with self.hold:
            self._worker.call("close_monitor")

    # The end --------------------------------------------------------------------------------

    def close(self) -> None:
        """Finish the monitor and close the environment; whoever waits learns that it is gone."""
        with self.hold:
            gone = self.hold.gone()
            self.hold.closed = True
            self.screen.end(gone)
            self._worker.begin_close()
            try:
                self._worker.call("close")
            finally:
                self._worker.close(gone)

    def condemn(self, why: GymServerError) -> None:
        """End the process at once.

        Who waits for it hears why, and so does everybody who comes later: none is stuck.
        """
        self._worker.kill(why)
        self.screen.end(why)

    def _end(self, why: GymServerError) -> None:
        self.screen.end(why)
        self._on_end(self, why)


def _sendable(action: Parts) -> Parts:
    """Return tensors whose bytes can be pickled."""
    tensors = {
        name: Tensor(tensor.dtype, tensor.shape, bytes(tensor.data))
        for name, tensor in action.tensors.items()
    }
    return Parts(tensors, action.texts)
