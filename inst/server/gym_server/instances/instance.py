"""One environment on the server: its lock, its watchers and its monitor."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gym_server.envs.config import EnvConfig
from gym_server.errors import GymServerError, invalid_parameter, unknown_instance
from gym_server.monitoring.monitor_directory import MonitorRoot
from gym_server.protocol.answers import JSON_FORM, AnswerForm
from gym_server.rendering.render_thread import RenderThread
from gym_server.threads.lock import InstanceLock
from gym_server.viewing.viewer import Viewer
from gym_server.viewing.watchable import Watchable

if TYPE_CHECKING:
    import numpy as np
    from gymnasium.spaces import Space

Seed = int | tuple[int | tuple[int, ...] | None, ...] | None


class Instance(Watchable):
    """An environment that a client created.

    ``LocalInstance`` implements the methods that start with an underscore, which are called with
    the lock held.

    Every method that resets, steps or draws the environment waits for its lock. If the instance is
    closed meanwhile, the method raises ``unknown_instance``, or why it was closed.

    Attributes:
        instance_id: set when the instance is listed; "" before.
        env_id: an id that creates the same environment again.
        config: what its client chose.
        single_action_space: the action space of one sub-environment.
        single_observation_space: the observation space of one sub-environment.
        viewer: shows it to watchers.
        steps: the number of steps of its sub-environments.
    """

    env_id: str
    single_action_space: Space
    single_observation_space: Space

    def __init__(self, config: EnvConfig, renderer: RenderThread) -> None:
        """Prepare the lock and the viewer.

        Args:
            config: what its client chose.
            renderer: the process's render thread.
        """
        self.instance_id = ""
        self.config = config
        self.renderer = renderer
        self.lock = InstanceLock(
            lambda: unknown_instance(self.instance_id),
            lambda call: f"{call}() of instance {self.instance_id} of {self.config}",
        )
        self.viewer = Viewer(self)
        self.steps = 0
        self._is_single = config.num_envs is None
        self._in_real_time = config.render_mode == "human"
        self._created = self.lock.used

    # Resets and steps -----------------------------------------------------------------------

    def reset(
        self,
        seed: Seed,
        options: dict | None,
        form: AnswerForm = JSON_FORM,
        mask: np.ndarray | None = None,
    ) -> dict:
        """Start an episode in every sub-environment, or in those of a mask.

        Args:
            seed: seeds the environment and the action space. None leaves both unchanged, or in the
                first reset uses the seed given at creation. With sub-environments, one seed from
                which each derives its own, or one seed each.
            options: options for the environment.
            form: the format of the response.
            mask: a boolean per sub-environment; None for all.

        Returns:
            ``{"observation", "info"}`` as JSON values. The observation is ``Parts`` if tensors are
            wanted and its space supports them; with sub-environments it is a batch.

        Raises:
            GymServerError: ``invalid_parameter``, ``not_supported``, ``reset_needed`` (a mask
                before the first reset); ``environment_error``.
        """
        if self._is_single:
            _refuse_mask("reset_mask", mask)
            if isinstance(seed, tuple):
                raise invalid_parameter("seed", seed, "an integer, 0 or greater")
        if self._in_real_time:
            self.viewer.pace()
        with self.lock:
            self.lock.call = "reset"
            return self._reset(seed, options, form, mask)

    def step(
        self,
        action: object,
        form: AnswerForm = JSON_FORM,
        mask: np.ndarray | None = None,
        in_real_time: bool = False,
    ) -> dict:
        """Take one step in every sub-environment, or in those of a mask.

        Args:
            action: an action as a JSON value or ``Parts``; the environment checks the bounds of a
                Box. With sub-environments, a list with a JSON value for each that steps, or a batch
                as ``Parts``.
            form: the format of the response.
            mask: a boolean per sub-environment; None for all.
            in_real_time: whether to slow down to real time while somebody watches.

        Returns:
            ``{"observation", "reward", "done", "terminated", "truncated", "info"}`` as JSON
            values; the observation as for ``reset()``. With sub-environments, one row for each
            that stepped: arrays if the observation is ``Parts``, else lists. If sub-environments
            ended and were reset at once, also ``final_obs``, a batch of their last observations,
            and ``final_sub_envs``, their row numbers.

        Raises:
            GymServerError: ``reset_needed`` (also for a sub-environment that ended and is not
                reset automatically), ``action_not_in_space``, ``invalid_parameter`` or
                ``not_supported``, each before the environment is stepped; ``environment_error``.
        """
        if mask is not None and self._is_single:
            _refuse_mask("step_mask", mask)
        if in_real_time or self._in_real_time:
            self.viewer.pace()
        with self.lock:
            self.lock.call = "step"
            return self._step(action, form, mask)

    def sample_action(self) -> object:
        """Sample an action, for each sub-environment, with the action space's generator."""
        with self.lock:
            self.lock.call = "sample_action"
            return self._sample_action()

    # Looks ----------------------------------------------------------------------------------

    def render(self, sub_env: int = 0) -> np.ndarray:
        """Draw the current state of a sub-environment; see ``png.picture()`` for the array.

        Raises:
            GymServerError: ``cannot_render``, ``reset_needed``, ``invalid_parameter``.
        """
        self.check_sub_env(sub_env)
        with self.lock:
            self.lock.call = "render"
            return self._render(sub_env)

    def check_sub_env(self, sub_env: int) -> None:
        """Raise ``invalid_parameter`` for a sub-environment that does not exist."""
        num_envs = self.config.num_envs or 1
        if sub_env >= num_envs:
            last = f"an integer from 0 to {num_envs - 1}" if num_envs > 1 else "0"
            raise invalid_parameter("sub_env", sub_env, f"{last} for this environment")

    def transition_model(self) -> dict:
        """Return the transition model of an environment that has one.

        Returns:
            ``{"model"}``, see ``envs.transition_model``.

        Raises:
            GymServerError: ``not_supported``; ``environment_error``.
        """
        if not self._is_single:
            raise GymServerError(
                "not_supported",
                f"{self.env_id} has sub-environments here, and only single environments have a "
                "transition model",
                "create it without num_envs",
            )
        with self.lock:
            self.lock.call = "transition_model"
            return self._transition_model()

    # At any time ----------------------------------------------------------------------------

    def space_info(self, name: str) -> dict:
        """Return the description of a space; with sub-environments, of the batched space.

        Args:
            name: "action_space" or "observation_space".
        """
        raise NotImplementedError

    def contains(self, name: str, claim: dict) -> bool:
        """Answer a client's "contains" question; see ``spaces.contains()``.

        Args:
            name: the space, as for ``space_info()``.
            claim: with sub-environments, its value has an entry for each.
        """
        raise NotImplementedError

    def list_entry(self) -> dict:
        """Return the entry in the list of instances."""
        now = time.monotonic()
        return {
            "instance_id": self.instance_id,
            "env_id": self.env_id,
            "name": self.config.name,
            "num_envs": self.config.num_envs,
            "age_seconds": now - self._created,
            "idle_seconds": now - self.lock.used,
            "steps": self.steps,
            "watched": self.viewer.is_watched,
        }

    def about(self) -> dict:
        """Return everything known about the instance, without waiting for its environment."""
        return {**self.list_entry(), **self._about()}

    @property
    def grown(self) -> int:
        """By how many bytes drawing and seeds have made the server's process grow."""
        return 0

    @property
    def pids(self) -> Sequence[int]:
        """The processes that run it, besides the server's."""
        return ()

    # Monitors -------------------------------------------------------------------------------

    def start_monitor(
        self, root: MonitorRoot, directory: str, force: bool, resume: bool, video_every: int
    ) -> None:
        """Record the episodes that start from now on; see ``Monitor``."""
        if not self._is_single:
            raise GymServerError(
                "not_supported",
                f"Instance {self.instance_id} has sub-environments, and monitors record only "
                "single environments",
                "create it without num_envs",
            )
        with self.lock:
            self.lock.call = "start_monitor"
            self._record(root.resolve(directory), directory, force, resume, video_every)

    def _record(
        self, path: Path, directory: str, force: bool, resume: bool, video_every: int
    ) -> None:
        """Record the episodes that start from now on.

        Args:
            path: the directory, already checked; see ``take_directory()``, also for the next three.
            directory: its name as the client sent it.
            force: whether to delete its contents.
            resume: whether to continue the numbering.
            video_every: record a video of every episode whose number is a multiple; 0 for none.
        """
        raise NotImplementedError

    def close_monitor(self) -> None:
        """Stop recording, if active, and finish the files.

        Raises:
            GymServerError: ``monitor_directory`` if something could not be written.
        """
        with self.lock:
            self.lock.call = "close_monitor"
            self._close_monitor()

    # Beginning and end ----------------------------------------------------------------------

    def report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        """Report from now on if the environment's process ends unexpectedly, or at once if it has.

        Args:
            on_end: called with the reason, after the watchers were told.
        """

        def end(why: GymServerError) -> None:
            self.viewer.end(why)
            on_end(why)

        self._report_end(end)

    def close(self) -> None:
        """Finish the monitor and close the environment; waiting calls get an error."""
        with self.lock:
            self.lock.call = "close"
            why = self.lock.refusal()
            self.lock.closed = True
            self.viewer.end(why)
            self._close(why)

    # What differs ---------------------------------------------------------------------------

    def _reset(
        self, seed: Seed, options: dict | None, form: AnswerForm, mask: np.ndarray | None
    ) -> dict:
        raise NotImplementedError

    def _step(self, action: object, form: AnswerForm, mask: np.ndarray | None) -> dict:
        raise NotImplementedError

    def _sample_action(self) -> object:
        raise NotImplementedError

    def _render(self, sub_env: int) -> np.ndarray:
        raise NotImplementedError

    def _transition_model(self) -> dict:
        raise NotImplementedError

    def _close_monitor(self) -> None:
        """Stop recording, if active, and finish the files."""
        raise NotImplementedError

    def _about(self) -> dict:
        """Return everything known about the environment, without waiting for it."""
        raise NotImplementedError

    def _report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        raise NotImplementedError

    def _close(self, why: GymServerError) -> None:
        """Finish the monitor and close the environment; later calls raise the reason."""
        raise NotImplementedError


def _refuse_mask(name: str, mask: np.ndarray | None) -> None:
    if mask is not None:
        raise GymServerError(
            "not_supported",
            f"'{name}' is for environments with sub-environments",
            "create it with num_envs",
        )
