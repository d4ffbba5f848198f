"""One environment on the server: what all have in common, whatever process runs them."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gym_server.envs.config import EnvConfig
from gym_server.errors import GymServerError, invalid_parameter, unknown_instance
from gym_server.monitoring.disk_use import DiskUse
from gym_server.monitoring.monitor_directory import MonitorRoot
from gym_server.protocol.answers import JSON_FORM, AnswerForm, Ready
from gym_server.rendering.render_thread import RenderThread
from gym_server.threads.lock import InstanceLock
from gym_server.viewing.viewer import Viewer
from gym_server.viewing.watchable import Watchable

if TYPE_CHECKING:
    import numpy as np

log = logging.getLogger(__name__)

Seed = int | tuple[int | tuple[int, ...] | None, ...] | None

# How often it is looked at what a monitor writes: less often than the shortest episodes end.
_MEASURE_SECONDS = 1.0


class Instance(Watchable):
    """One environment that a client has created.

    ``LocalInstance`` plays it in this process, ``IsolatedInstance`` in one of its own. What differs
    is in their methods of the names that begin with an underscore here; those are called by a
    thread that has the lock.

    Every method that resets, steps or draws the environment waits for its lock; one that waited
    while the instance was being closed raises ``unknown_instance``, or why it was closed.

    Attributes:
        instance_id: given when the instance is listed, "" before.
        env_id: what the environment can be created by again.
        config: what its client wanted.
        viewer: shows it to watchers.
        steps: how many steps its sub-environments have taken.
        can_be_killed: whether ``kill()`` ends every call on it, so that none can be stuck.
    """

    env_id: str
    can_be_killed: bool

    def __init__(self, config: EnvConfig, renderer: RenderThread) -> None:
        """Prepare the lock and the viewer.

        Args:
            config: what its client wants.
            renderer: the process's render thread.
        """
        self.instance_id = ""
        self.config = config
        self.renderer = renderer
        self.lock = InstanceLock(
            lambda: unknown_instance(self.instance_id), self._close_abandoned, renderer.began
        )
        self.viewer = Viewer(self)
        self.steps = 0
        self._is_single = config.num_envs is None
        self._in_real_time = config.render_mode == "human"
        self._created = self.lock.used
        # Where a monitor writes, if one does; when that was measured; why the last one stopped.
        self._monitored: tuple[Path, DiskUse] | None = None
        self._measured = 0.0
        self._monitor_full: GymServerError | None = None

    # Resets and steps -----------------------------------------------------------------------

    def reset(
        self,
        seed: Seed,
        options: dict | None,
        form: AnswerForm = JSON_FORM,
        mask: np.ndarray | None = None,
    ) -> dict | Ready:
        """Start an episode; in every sub-environment, or in those of a mask.

        Args:
            seed: seeds the environment and the action space; None leaves both as they are, or
                takes the seed given at creation in the first reset. For sub-environments one for
                all, each of which makes its own of it, or one for each.
            options: the environment's own.
            form: what is wanted of the answer.
            mask: a boolean for each sub-environment; None for all of them.

        Returns:
            ``{"observation", "info"}`` as JSON values; the observation as ``Parts`` when tensors
            are wanted and its space can travel so; with sub-environments a batch. ``Ready`` from
            the process of an isolated environment.

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
            if self._monitored is not None:
                self._stop_full_monitor(*self._monitored)
            return self._reset(seed, options, form, mask)

    def step(
        self,
        action: object,
        form: AnswerForm = JSON_FORM,
        mask: np.ndarray | None = None,
        in_real_time: bool = False,
    ) -> dict | Ready:
        """Take one step; in every sub-environment, or in those of a mask.

        Args:
            action: the JSON value of an action, or the action as ``Parts``; the bounds of a
                Box are the environment's affair. With sub-environments a list of one JSON value
                for each that steps, or a batch as ``Parts``.
            form: what is wanted of the answer.
            mask: a boolean for each sub-environment; None for all of them.
            in_real_time: whether people want to see it: not faster than in real time, then, while
                somebody watches.

        Returns:
            ``{"observation", "reward", "done", "terminated", "truncated", "info"}`` as JSON
            values; the observation as for ``reset()``. With sub-environments one row for each
            that stepped: arrays where the observation is ``Parts``, else lists. When
            sub-environments ended and were reset at once also ``final_obs``, a batch of their last
            observations, and ``final_sub_envs``, the rows that they are.

        Raises:
            GymServerError: ``reset_needed`` (also for a sub-environment that ended and is not
                reset by itself), ``action_not_in_space``, ``invalid_parameter`` or
                ``not_supported``, each before the environment is stepped; ``environment_error``.
        """
        if mask is not None and self._is_single:
            _refuse_mask("step_mask", mask)
        if in_real_time or self._in_real_time:
            self.viewer.pace()
        with self.lock:
            return self._step(action, form, mask)

    def sample_action(self) -> object:
        """Draw an action, for each sub-environment, from the action space's own generator."""
        with self.lock:
            return self._sample_action()

    # Looks ----------------------------------------------------------------------------------

    def render(self, sub_env: int = 0) -> np.ndarray:
        """Draw the current state of a sub-environment; see ``png.picture()`` for the array.

        Raises:
            GymServerError: ``cannot_render``, ``reset_needed``, ``invalid_parameter``.
        """
        self.check_sub_env(sub_env)
        with self.lock:
            return self._render(sub_env)

    def check_sub_env(self, sub_env: int) -> None:
        """Raise ``invalid_parameter`` for a sub-environment that does not exist."""
        num_envs = self.config.num_envs or 1
        if sub_env >= num_envs:
            last = f"an integer from 0 to {num_envs - 1}" if num_envs > 1 else "0"
            raise invalid_parameter("sub_env", sub_env, f"{last} for this environment")

    def transition_model(self) -> dict | Ready:
        """Tell how an environment moves that has a table of it.

        Returns:
            ``{"model"}``, see ``envs.transition_model``; ``Ready`` from the process of an isolated
            environment.

        Raises:
            GymServerError: ``not_supported``; ``environment_error``.
        """
        if not self._is_single:
            raise GymServerError(
                "not_supported",
                f"{self.env_id} has sub-environments here, and a transition model is that of a "
                "single environment",
                "create it without num_envs",
            )
        with self.lock:
            return self._transition_model()

    # At any time ----------------------------------------------------------------------------

    def space_info(self, name: str) -> dict:
        """Return the description of a space, of sub-environments that of the batched one.

        Args:
            name: "action_space" or "observation_space".
        """
        raise NotImplementedError

    def contains(self, name: str, claim: dict) -> bool:
        """Answer a client's "contains"; see ``spaces.contains()``.

        Args:
            name: of the space, as for ``space_info()``.
            claim: a value has an entry for each sub-environment.
        """
        raise NotImplementedError

    def list_entry(self) -> dict:
        """Return what the list of instances shows of it."""
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
        """Return all that is known of the instance, without waiting for its environment."""
        about = self._about()
        entry = self.list_entry()
        # The entry comes last, because what the process of an isolated environment sends has an
        # entry of that process, which knows neither the id nor the watchers. It also comes first,
        # so that its values stand at the beginning of the answer.
        return {**entry, **about, **entry}

    @property
    def busy_since(self) -> float | None:
        """Since when a call has waited for the environment, in the clock's seconds, or None."""
        since = (self.lock.busy_since, self.query_since)
        return min((one for one in since if one is not None), default=None)

    @property
    def query_since(self) -> float | None:
        """Since when a call that needs no lock has waited, in the clock's seconds, or None."""
        return None

    @property
    def grown(self) -> int:
        """By how many bytes drawing and seeds have made the server's process grow."""
        return 0

    @property
    def pids(self) -> Sequence[int]:
        """The processes that run it, beside the server's."""
        raise NotImplementedError

    # Monitors -------------------------------------------------------------------------------

    def start_monitor(
        self, root: MonitorRoot, directory: str, force: bool, resume: bool, video_every: int
    ) -> None:
        """Record the episodes that start from now on; see ``Monitor``."""
        if not self._is_single:
            raise GymServerError(
                "not_supported",
                f"Instance {self.instance_id} has sub-environments, and a monitor records single "
                "environments",
                "create it without num_envs",
            )
        with self.lock:
            path, disk_use = root.resolve(directory), root.disk_use
            disk_use.check(path, emptied=force)
            self.record(path, directory, force, resume, video_every)
            self._monitored, self._monitor_full = (path, disk_use), None
            self._measure_monitor()

    def record(
        self, path: Path, directory: str, force: bool, resume: bool, video_every: int
    ) -> None:
        """Record the episodes that start from now on; the caller has the lock.

        Args:
            path: the directory that is allowed; see ``take_directory()``, also for the next three.
            directory: as the client names it.
            force: whether to delete what is there.
            resume: whether to go on counting.
            video_every: record a video of each episode whose number this divides; 0 for none.
        """
        raise NotImplementedError

    def close_monitor(self) -> None:
        """Stop recording and finish the files, if it is recorded.

        Raises:
            GymServerError: ``monitors_full`` when something was not recorded for that reason;
                ``monitor_directory`` when something could not be written.
        """
        with self.lock, self._monitor_ends():
            self._close_monitor()

    @contextlib.contextmanager
    def _monitor_ends(self) -> Iterator[None]:
        """Measure what a monitor leaves, and say whether it had no more room."""
        try:
            yield
        finally:
            self._measure_monitor()
            self._monitored = None
        full, self._monitor_full = self._monitor_full, None
        if full is not None:
            raise full

    def _measure_monitor(self) -> None:
        if self._monitored is not None:
            path, disk_use = self._monitored
            disk_use.measure(path)
            self._measured = time.monotonic()

    def _stop_full_monitor(self, path: Path, disk_use: DiskUse) -> None:
        """Stop to record, if monitors may write no more; the environment goes on."""
        if time.monotonic() < self._measured + _MEASURE_SECONDS:
            return
        self._measure_monitor()
        try:
            disk_use.check(path)
        except GymServerError as full:
            log.warning("%s", full.message)
            with contextlib.suppress(GymServerError), self._monitor_ends():
                self._close_monitor()
            self._monitor_full = full

    # Beginning and end ----------------------------------------------------------------------

    def report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        """From now on report when the environment's process ends by itself, or at once if it has.

        Args:
            on_end: called with the reason, after the watchers got it.
        """

        def end(why: GymServerError) -> None:
            self.viewer.end(why)
            on_end(why)

        self._report_end(end)

    def close(self) -> None:
        """Finish the monitor and close the environment; waiting calls get an error."""
        with self.lock:
            why = self.lock.refusal()
            self.lock.closed = True
            self.viewer.end(why)
            with self._monitor_ends():
                self._close(why)

    def abandon(self, why: GymServerError) -> int | None:
        """Close the instance without waiting for its lock: a call on it has taken too long.

        Args:
            why: the error for every call that waits for the instance.

        Returns:
            The thread that is stuck in the environment and cannot answer for itself, or None.
        """
        if self.can_be_killed:
            self.kill(why)
            self.viewer.end(why)
            return None
        stuck = self.lock.abandon(why)
        self.viewer.end(why)
        self.kill(why)
        if stuck is None:
            # The call has just come back.
            threading.Thread(target=self._close_abandoned_when_free, daemon=True).start()
            return None
        return None if self.renderer.abandon(stuck, why) else stuck

    def kill(self, why: GymServerError) -> None:
        """Kill the processes that the environment runs in, if it has any of its own.

        Args:
            why: the error for the calls that this ends.
        """
        raise NotImplementedError

    def _close_abandoned_when_free(self) -> None:
        with self.lock.when_free():
            self._close_abandoned()

    # What differs ---------------------------------------------------------------------------

    def _reset(
        self, seed: Seed, options: dict | None, form: AnswerForm, mask: np.ndarray | None
    ) -> dict | Ready:
        raise NotImplementedError

    def _step(self, action: object, form: AnswerForm, mask: np.ndarray | None) -> dict | Ready:
        raise NotImplementedError

    def _sample_action(self) -> object:
        raise NotImplementedError

    def _render(self, sub_env: int) -> np.ndarray:
        raise NotImplementedError

    def _transition_model(self) -> dict | Ready:
        raise NotImplementedError

    def _close_monitor(self) -> None:
        """Stop recording and finish the files, if it is recorded."""
        raise NotImplementedError

    def _about(self) -> dict:
        """Return what is known of the environment, without waiting for it."""
        raise NotImplementedError

    def _report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        raise NotImplementedError

    def _close(self, why: GymServerError) -> None:
        """Finish the monitor and close the environment; the reason is for calls that come late."""
        raise NotImplementedError

    def _close_abandoned(self) -> None:
        """Close what was abandoned, once the call that took too long has come back."""
        raise NotImplementedError


def _refuse_mask(name: str, mask: np.ndarray | None) -> None:
    if mask is not None:
        raise GymServerError(
            "not_supported",
            f"'{name}' is for environments with sub-environments",
            "create it with num_envs",
        )
