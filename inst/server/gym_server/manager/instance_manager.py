"""Create, list, close and evict the environments of all clients."""

from __future__ import annotations

import contextlib
import logging
import secrets
import threading
import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from typing import Any

from gym_server.budget import Budget
from gym_server.envs import allowed_paths, registry, wrappers
from gym_server.envs.config import EnvConfig
from gym_server.envs.memory_reservation import MemoryReservation
from gym_server.errors import (
    GymServerError,
    idle_closed,
    memory_closed,
    rollout_memory_closed,
    shutting_down,
    unknown_instance,
)
from gym_server.instances.about import list_entry
from gym_server.instances.factory import make_instance
from gym_server.instances.instance import Instance
from gym_server.manager.account import Account
from gym_server.manager.limits import Limits, Room
from gym_server.manager.rollouts import Rollouts
from gym_server.processes import memory
from gym_server.processes.pool import pool
from gym_server.rendering.render_thread import RenderThread
from gym_server.rollouts.task import Task
from gym_server.threads import calls
from gym_server.vector_envs import make_vec
from gym_server.vector_envs.num_workers import most_workers

log = logging.getLogger(__name__)

_MB = 2**20

# So many reasons why instances were closed are kept.
_MOST_REASONS = 1000


@dataclass
class _Taken:
    """An environment's share of the server's limits, until it is closed."""

    room: Room
    reservation: MemoryReservation


@dataclass(eq=False)
class _Creation:
    """An environment that is being created.

    Attributes:
        config: what its client chose.
        taken: its share of the server's limits.
    """

    config: EnvConfig
    taken: _Taken


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
        # Whether an environment was closed since the last garbage collection. The watchdog collects
        # garbage and resets this.
        self.left_garbage = False
        self._budget = Budget(self._limits.max_memory_mb * _MB)
        self.account = Account(self._budget.limit)
        # Set while an instance that took too much memory is being closed.
        self._evicting = threading.Event()
        # By creation until it ends, then by instance_id until the instance is closed.
        self._taken: dict[_Creation | str, _Taken] = {}
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
        with (
            self._room_for(config) as creation,
            calls.call(lambda: f"Making {config}"),
            contextlib.ExitStack() as undo,
        ):
            instance = self._make(creation, undo)
            self._enlist(instance, creation)
            undo.pop_all()
        instance.report_end(lambda why: self._remove(instance.instance_id, why))
        log.info("Created instance %s of %s", instance.instance_id, instance.env_id)
        return instance

    def _enlist(self, instance: Instance, creation: _Creation) -> None:
        """Add an instance to the list."""
        with self._lock:
            if self._stopping:
                raise shutting_down()
            instance.instance_id = self._new_id()
            self._instances[instance.instance_id] = instance
            self._taken[instance.instance_id] = self._taken.pop(creation)

    @contextlib.contextmanager
    def _room_for(self, config: EnvConfig) -> Iterator[_Creation]:
        """Reserve room for an environment while it is created."""
        workers = most_workers(config)
        reservation = MemoryReservation(self._budget, config.num_envs or 1)
        with self._lock:
            taken = sum((one.room for one in list(self._taken.values())), Room(0))
            if not config.wants_workers:
                workers = min(workers, max(0, self._limits.max_processes - taken.processes))
            room = Room(config.num_envs or 1, workers)
            creation = _Creation(replace(config, max_workers=workers), _Taken(room, reservation))
            self._limits.check_room(len(self._taken), taken, room)
            self._taken[creation] = creation.taken
        try:
            yield creation
        finally:
            self._release(creation)

    def _release(self, whose: _Creation | str) -> None:
        """Release the share of an environment that was closed, or not created after all."""
        taken = self._taken.pop(whose, None)
        if taken is not None:
            taken.reservation.give_back()
            self.left_garbage = True

    def _make(self, creation: _Creation, undo: contextlib.ExitStack) -> Instance:
        taken = creation.taken
        instance = make_instance(
            creation.config,
            self._allowed_modules,
            self._limits.max_num_envs,
            self._renderer,
            undo,
            taken.reservation,
        )
        # Release the room for processes that were not needed.
        with self._lock:
            taken.room = replace(taken.room, processes=instance.num_workers or 0)
        return instance

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
        return Task(config, self._allowed_modules, self._budget.limit, **what)

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

    def _close_in_background(
        self, instance: Instance, then: Callable[[], None] = lambda: None
    ) -> threading.Thread:
        def close() -> None:
            try:
                self._close(instance)
            except GymServerError as error:
                log.warning("Closing instance %s: %s", instance.instance_id, error)
            finally:
                then()

        closer = threading.Thread(target=close, daemon=True)
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

    def evict_largest(self, rollouts: Rollouts) -> None:
        """Close the instance that has grown most, if the memory limit is exceeded.

        Unused memory is released first. If a rollout process has grown more, that is killed
        instead.
        """
        self.account.measure()
        if not self.account.is_exceeded or self._evicting.is_set():
            return
        pool.end()
        memory.give_back()
        self.account.measure()
        if not self.account.is_exceeded:
            return
        sizes = {one: one.grown + self.account.of(one.pids) for one in self._all()}
        instance = max(sizes, key=sizes.__getitem__, default=None)
        playing = {pid: self.account.of([pid]) for pid in rollouts.pids()}
        largest = max(playing, key=playing.__getitem__, default=None)
        grown = sizes[instance] if instance is not None else 0
        if largest is not None and playing[largest] > grown:
            rollouts.kill(largest, rollout_memory_closed(playing[largest] / _MB))
            return
        if instance is None or grown <= 0:
            return
        why = memory_closed(instance.instance_id, instance.env_id, grown / _MB)
        if self._unlist(instance.instance_id, why) is not None:
            log.warning("%s", why.message)
            self._evicting.set()
            self._close_in_background(instance, self._note_evicted)

    def _note_evicted(self) -> None:
        memory.give_back()
        self._evicting.clear()

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
            if instance_id not in self._instances and instance_id not in self._reasons:
                return instance_id
