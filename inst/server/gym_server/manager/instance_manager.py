"""Create, list, close and evict the environments of all clients."""

from __future__ import annotations

import contextlib
import logging
import secrets
import threading
import time
from collections.abc import Collection
from dataclasses import replace
from typing import Any

from gym_server import memory
from gym_server.envs import allowed_paths, registry, wrappers
from gym_server.envs.config import EnvConfig
from gym_server.errors import GymServerError, idle_closed, shutting_down, unknown_instance
from gym_server.instances.about import list_entry
from gym_server.instances.factory import make_instance
from gym_server.instances.instance import Instance
from gym_server.manager.limits import Limits
from gym_server.processes.pool import pool
from gym_server.rendering.render_thread import RenderThread
from gym_server.rollouts.task import Task
from gym_server.threads import calls
from gym_server.vector_envs import make_vec
from gym_server.vector_envs.num_workers import most_workers

log = logging.getLogger(__name__)

# So many reasons why instances were closed are kept.
_MOST_REASONS = 1000


class InstanceManager:
    """All instances of a server."""

    def __init__(
        self,
        allowed_modules: Collection[str],
        renderer: RenderThread,
        limits: Limits | None = None,
        may_name_files: bool = True,
    ) -> None:
        """Start with no instances.

        Args:
            allowed_modules: the modules that an env_id may import.
            renderer: the process's render thread.
            limits: how many instances there may be, and how large.
            may_name_files: whether arguments of environments may be paths of files.
        """
        self._limits = limits or Limits()
        self._may_name_files = may_name_files
        self._allowed_modules = frozenset(allowed_modules)
        self._renderer = renderer
        self._lock = threading.Lock()
        self._instances: dict[str, Instance] = {}
        # Whether an environment was closed since the last garbage collection. Who collects garbage,
        # such as the watchdog, resets this.
        self.left_garbage = False
        # How many processes each instance takes, from the start of its creation until it is closed.
        self._workers: dict[str, int] = {}
        # Why the server closed the last instances that it closed itself, by instance_id.
        self._reasons: dict[str, GymServerError] = {}
        self._stopping = False

    def create(self, config: EnvConfig) -> Instance:
        """Create an environment. Its instance_id has 8 hex digits.

        Raises:
            GymServerError: see ``factory.make_instance()``; ``invalid_kwargs``, ``shutting_down``,
                ``environment_died``, ``too_many_instances``, ``too_many_sub_envs``,
                ``too_many_processes``, ``too_much_memory``.
        """
        # Check these first, before creating anything.
        allowed_paths.check(config, self._may_name_files)
        wrappers.check(config.wrappers)
        if config.num_envs is None:
            make_vec.check_single(config)
        instance_id, config = self._take_room(config)
        if self.left_garbage and memory.is_short():
            # The new environment may need what closed ones still hold. A library without memory
            # would end the server.
            self.left_garbage = False
            memory.give_back()
        try:
            with calls.call(lambda: f"Making {config}"), contextlib.ExitStack() as undo:
                instance = make_instance(
                    config, self._allowed_modules, self._limits.max_num_envs, self._renderer, undo
                )
                self._enlist(instance, instance_id)
                undo.pop_all()
        except BaseException:
            self._release(instance_id)
            raise
        instance.report_end(lambda why: self._remove(instance.instance_id, why))
        log.info("Created instance %s of %s", instance.instance_id, instance.env_id)
        return instance

    def _enlist(self, instance: Instance, instance_id: str) -> None:
        """Add an instance to the list."""
        with self._lock:
            if self._stopping:
                raise shutting_down()
            instance.instance_id = instance_id
            self._instances[instance_id] = instance
            # It may take fewer processes than it could have.
            self._workers[instance_id] = instance.num_workers or 0

    def _take_room(self, config: EnvConfig) -> tuple[str, EnvConfig]:
        """Reserve room for an environment; return its instance_id, and what it may have."""
        workers = most_workers(config)
        with self._lock:
            left = max(0, self._limits.max_processes - sum(self._workers.values()))
            if not config.wants_workers:
                workers = min(workers, left)
            self._limits.check_room(len(self._workers), left, workers)
            instance_id = self._new_id()
            self._workers[instance_id] = workers
        return instance_id, replace(config, max_workers=workers)

    def _release(self, instance_id: str) -> None:
        """Release the room of an environment that was closed, or not created after all."""
        with self._lock:
            if self._workers.pop(instance_id, None) is not None:
                self.left_garbage = True

    def registered(self, search: str | None) -> list[dict]:
        """Return the environments that can be created; see ``registry.search()``."""
        return registry.search(search, self._allowed_modules)

    def rollout_task(self, config: EnvConfig, **what: Any) -> Task:
        """Return the task of a rollout.

        Args:
            config: the environment.
            **what: the other arguments of ``Task``.

        Raises:
            GymServerError: the client may not use this environment, wrapper or path.
        """
        allowed_paths.check(config, self._may_name_files)
        wrappers.check(config.wrappers)
        return Task(config, self._allowed_modules, **what)

    def get(self, instance_id: str) -> Instance:
        """Return an instance.

        Raises:
            GymServerError: ``unknown_instance``, or why the server closed it.
        """
        try:
            return self._instances[instance_id]
        except KeyError:
            raise self._why(instance_id) from None

    def lives(self, instance_id: str) -> bool:
        """Return whether an instance exists."""
        return instance_id in self._instances

    def env_ids(self) -> dict[str, str]:
        """Return every instance's env_id by its instance_id."""
        with self._lock:
            return {key: instance.env_id for key, instance in self._instances.items()}

    def close(self, instance_id: str) -> None:
        """Close an instance for its owner; it becomes unknown."""
        instance = self._unlist(instance_id)
        if instance is None:
            raise self._why(instance_id)
        self._close(instance)
        log.info("Closed instance %s", instance_id)

    def _unlist(self, instance_id: str, why: GymServerError | None = None) -> Instance | None:
        """Remove an instance from the list; later calls on it raise the reason."""
        with self._lock:
            instance = self._instances.pop(instance_id, None)
            if instance is not None and why is not None:
                instance.lock.why = why
                # A copy: an exception that was raised refers to its stack, and so to the
                # environment.
                self._reasons[instance_id] = why.again()
                while len(self._reasons) > _MOST_REASONS:
                    del self._reasons[next(iter(self._reasons))]
            return instance

    def _why(self, instance_id: str) -> GymServerError:
        """Return the error for an instance that is unknown, or was closed by the server."""
        why = self._reasons.get(instance_id)
        return unknown_instance(instance_id) if why is None else why.again()

    def _close(self, instance: Instance) -> None:
        try:
            instance.close()
        finally:
            self._release(instance.instance_id)

    def _close_in_background(self, instance: Instance) -> threading.Thread:
        def close() -> None:
            try:
                self._close(instance)
            except GymServerError as error:
                log.warning("Closing instance %s: %s", instance.instance_id, error)

        closer = threading.Thread(target=close, daemon=True)
        with memory.for_threads():
            closer.start()
        return closer

    def _all(self) -> tuple[Instance, ...]:
        with self._lock:
            return tuple(self._instances.values())

    def list(self) -> list[dict]:
        """Return the list entries of all instances, oldest first, without waiting for any."""
        return [list_entry(instance) for instance in self._all()]

    def _remove(self, instance_id: str, why: GymServerError) -> None:
        """Remove an instance whose process has ended; keep the reason."""
        self._unlist(instance_id, why)
        self._release(instance_id)

    def evict_idle(self, minutes: float) -> None:
        """Close the instances that nobody has used or watched for this long."""
        now = time.monotonic()
        for instance in self._all():
            lock = instance.lock
            if max(lock.used, lock.watched) > now - minutes * 60 or lock.is_held:
                continue
            if instance.viewer.is_watched:
                lock.watched = now
                continue
            why = idle_closed(instance.instance_id, instance.env_id, minutes)
            if self._unlist(instance.instance_id, why) is not None:
                log.info("%s", why.message)
                self._close_in_background(instance)

    def end_watching(self) -> None:
        """Answer all watchers with an error, because the server is about to stop."""
        for instance in self._all():
            instance.viewer.end(shutting_down())

    def close_all(self) -> None:
        """Close every instance and create no more; end the idle processes."""
        with self._lock:
            self._stopping = True
            instances = list(self._instances.values())
            self._instances.clear()
        # In parallel, so that one that hangs does not keep the others from finishing monitors.
        for closer in [self._close_in_background(instance) for instance in instances]:
            closer.join()
        # Last, because closing puts processes there.
        pool.end()

    def _new_id(self) -> str:
        while True:
            instance_id = secrets.token_hex(4)
            if instance_id not in self._workers and instance_id not in self._reasons:
                return instance_id
