"""The environments that clients made, by instance_id."""

from __future__ import annotations

import contextlib
import logging
import secrets
import threading
import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from gym_server.budget import Budget
from gym_server.envs import registry, vectorization, wrappers
from gym_server.envs.allowed_paths import AllowedPaths
from gym_server.envs.config import EnvConfig
from gym_server.envs.memory_reservation import MemoryReservation
from gym_server.errors import GymServerError, call_too_long, idle_closed, shutting_down
from gym_server.instances.factory import make_instance
from gym_server.instances.instance import Instance
from gym_server.instances.lock import SETTLED_SECONDS
from gym_server.isolation.isolated_instance import IsolatedInstance
from gym_server.isolation.policy import Isolation
from gym_server.manager.limits import Limits, Room
from gym_server.manager.tombstones import Departed
from gym_server.rendering.render_thread import RenderThread
from gym_server.threads.interrupt import interrupt

log = logging.getLogger(__name__)


class _Share(NamedTuple):
    """What an environment takes of what there is for all, until it is gone."""

    room: Room
    account: MemoryReservation


@dataclass
class _Making:
    """An environment that is being made.

    Attributes:
        choices: what its client wants.
        share: what it takes of what there is for all.
        condemn: ends what the making thread waits for, so that it answers for itself; None
            where that cannot be done.
        began: in the clock's seconds.
        settled: whether it was answered for, once it is given up.
    """

    choices: EnvConfig
    share: _Share
    condemn: Callable[[GymServerError], None] | None = None
    began: float = field(default_factory=time.monotonic)
    settled: threading.Event = field(default_factory=threading.Event)

    def too_long(self, seconds: float) -> GymServerError:
        return call_too_long(
            f"Making {self.choices.env_id}", seconds, "the server does not wait for it any more"
        )


class Instances:
    """All instances of a server."""

    def __init__(
        self,
        allowed_modules: Collection[str],
        renderer: RenderThread,
        limits: Limits | None = None,
        isolation: Isolation | None = None,
        allowed_paths: AllowedPaths | None = None,
    ) -> None:
        """Start with none.

        Args:
            allowed_modules: names of the modules that an env_id may import.
            renderer: the process's render thread.
            limits: how many of them there may be, and how large.
            isolation: which of them get a process of their own; None for none.
            allowed_paths: what clients may name of this machine's files; None for anything.
        """
        self._limits = limits or Limits()
        self._isolation = isolation or Isolation()
        self._allowed_paths = allowed_paths or AllowedPaths()
        self._allowed_modules = frozenset(allowed_modules)
        self._renderer = renderer
        self._lock = threading.Lock()
        self._instances: dict[str, Instance | IsolatedInstance] = {}
        # Whether environments are gone since somebody, who then changes it, looked for garbage.
        self.left_garbage = False
        self._budget = Budget(self._limits.max_memory_mb * 2**20)
        # By the thread that makes it until it comes back, then by instance_id until it is closed.
        self._shares: dict[int | str, _Share] = {}
        # By the thread that makes it; by instance_id.
        self._creating: dict[int, _Making] = {}
        self._closing: dict[str, Instance | IsolatedInstance] = {}
        self._departed = Departed()
        self._stopping = False

    def create(self, choices: EnvConfig) -> str:
        """Make an environment and return its instance_id, 8 hex digits.

        Raises:
            GymServerError: see ``factory.make_instance()``; ``invalid_kwargs``, ``shutting_down``,
                ``environment_died``, ``too_many_instances``, ``too_many_sub_envs``,
                ``too_many_processes``, ``too_much_memory``; ``call_too_long``.
        """
        # Before an environment is made for nothing.
        self._allowed_paths.check(choices)
        wrappers.check(choices.wrappers)
        if choices.num_envs is None:
            vectorization.check_single(choices)
        isolated = self._isolation.wants(choices.env_id, self._allowed_modules)
        make_it = self._make_isolated if isolated else self._make
        with self._room_for(choices, isolated) as making, contextlib.ExitStack() as undo:
            instance = make_it(choices, making, undo)
            if not self._enlist(instance, making):
                undo.close()
                raise making.too_long(self._limits.max_call_seconds)
            undo.pop_all()
        instance.stay()
        log.info("Made instance %s of %s", instance.instance_id, instance.env_id)
        return instance.instance_id

    def _enlist(self, instance: Instance, making: _Making) -> bool:
        """Put an instance on the list, unless its making was given up meanwhile."""
        with self._lock:
            if self._stopping:
                raise shutting_down()
            thread = threading.get_ident()
            if self._creating.pop(thread, None) is None:
                return False
            instance.instance_id = self._new_id()
            self._instances[instance.instance_id] = instance
            self._shares[instance.instance_id] = self._shares.pop(thread)
            return True

    @contextlib.contextmanager
    def _room_for(self, choices: EnvConfig, isolated: bool) -> Iterator[_Making]:
        """Keep room for an environment while it is made."""
        room = Room(choices.num_envs or 1, _processes_of(choices, isolated))
        share = _Share(room, MemoryReservation(self._budget, room.sub_envs))
        making, thread = _Making(choices, share), threading.get_ident()
        with self._lock:
            taken = sum((one.room for one in list(self._shares.values())), Room(0))
            instances = len(self._instances) + len(self._creating)
            self._limits.check_room(instances, taken, room)
            self._creating[thread] = making
            self._shares[thread] = share
        try:
            yield making
        except BaseException:
            if self._creating.pop(thread, None) is None:
                # Given up. Else the answer that is given on its behalf might go to its next
                # request.
                making.settled.wait(SETTLED_SECONDS)
                raise making.too_long(self._limits.max_call_seconds) from None
            raise
        finally:
            self._release(thread)

    def _release(self, whose: int | str) -> None:
        """Give the share of an environment that is gone, or came to nothing, to the others."""
        share = self._shares.pop(whose, None)
        if share is not None:
            share.account.give_back()
            self.left_garbage = True

    def _make(self, choices: EnvConfig, making: _Making, undo: contextlib.ExitStack) -> Instance:
        return make_instance(
            choices,
            self._allowed_modules,
            self._limits.max_num_envs,
            self._renderer,
            undo,
            making.share.account,
        )

    def _make_isolated(
        self, choices: EnvConfig, making: _Making, undo: contextlib.ExitStack
    ) -> IsolatedInstance:
        surroundings = self._isolation.surroundings(
            choices.env_id, self._allowed_modules, self._limits.max_num_envs, self._budget.left
        )
        instance = IsolatedInstance(
            choices, surroundings, lambda one, why: self.bury(one.instance_id, why)
        )
        undo.callback(instance.condemn, shutting_down())
        making.condemn = instance.condemn
        instance.create(making.share.account)
        return instance

    def registered(self, search: str | None) -> list[dict]:
        """Return what can be created; see ``registry.search()``."""
        if self._isolation.mode != "none" and self._allowed_modules:
            return self._isolation.search(
                search, self._allowed_modules, self._limits.max_call_seconds
            )
        return registry.search(search, self._allowed_modules)

    def get(self, instance_id: str) -> Instance | IsolatedInstance:
        """Return an instance.

        Raises:
            GymServerError: ``unknown_instance``, or why the server closed it.
        """
        try:
            return self._instances[instance_id]
        except KeyError:
            raise self._departed.why(instance_id) from None

    def lives(self, instance_id: str) -> bool:
        """Tell whether there is an instance of this id."""
        return instance_id in self._instances

    def env_ids(self) -> dict[str, str]:
        """Return every instance's env_id by its instance_id."""
        with self._lock:
            return {key: instance.env_id for key, instance in self._instances.items()}

    def close(self, instance_id: str) -> None:
        """Close an instance; from now on it is unknown."""
        instance = self._take_off(instance_id)
        if instance is None:
            raise self._departed.why(instance_id)
        self._close(instance)
        log.info("Closed instance %s", instance_id)

    def _take_off(self, instance_id: str, why: GymServerError | None = None) -> Instance | None:
        """Take an instance off the list, with the reason for those who will ask for it."""
        with self._lock:
            instance = self._instances.pop(instance_id, None)
            if instance is None:
                return None
            if why is not None:
                instance.hold.why = why
                self._departed.add(instance_id, why)
            # From now on nobody else would notice that this takes too long.
            self._closing[instance_id] = instance
            return instance

    def _close(self, instance: Instance) -> None:
        try:
            instance.close()
        finally:
            self._closing.pop(instance.instance_id, None)
            self._release(instance.instance_id)

    def _close_and_log(self, instance: Instance) -> None:
        try:
            self._close(instance)
        except GymServerError as error:
            log.warning("Closing instance %s: %s", instance.instance_id, error)

    def list(self) -> list[dict]:
        """Return what can be told of every instance at once, the oldest first."""
        with self._lock:
            instances = list(self._instances.values())
        return [instance.line() for instance in instances]

    def give_up_overdue(
        self, seconds: float, answer_for: Callable[[int, GymServerError], None]
    ) -> None:
        """Give up the instances on which a call takes too long; the others go on.

        Args:
            seconds: how long it may take.
            answer_for: answers for a thread that is stuck and cannot.
        """
        before = time.monotonic() - seconds
        for thread, making in list(self._creating.items()):
            began = self._renderer.began(thread) or making.began
            if began < before and self._is_taken_off(thread, making):
                why = making.too_long(seconds)
                log.warning("%s", why.message)
                if making.condemn is not None:
                    making.condemn(why)
                elif not self._renderer.give_up(thread, why):
                    answer_for(thread, why)
                    # Broken off while it asks for a process, it would break the fork server, and
                    # that all processes of others.
                    if not making.share.room.processes:
                        interrupt(thread)
                making.settled.set()
        with self._lock:
            instances = [*self._instances.values(), *self._closing.values()]
        for instance in instances:
            since = instance.busy_since
            if since is not None and since < before:
                why = self._dismiss(instance, seconds)
                stuck = instance.condemn(why)
                if stuck is not None:
                    answer_for(stuck, why)
                    # Until this is settled it does not go on to other things.
                    interrupt(stuck)
                instance.hold.settle()
        # The closing of what was given up may hang, too, and no instance stands for it any more.
        nobodys = call_too_long("Closing an environment", seconds, "the server leaves it alone")
        if self._renderer.give_up_what_began_before(before - seconds, nobodys):
            log.warning("%s", nobodys.message)

    def _is_taken_off(self, thread: int, making: _Making) -> bool:
        """Take a creation off the list; tell whether it was still there."""
        with self._lock:
            # The thread may be at its next one by now.
            if self._creating.get(thread) is not making:
                return False
            del self._creating[thread]
            return True

    def _dismiss(self, instance: Instance, seconds: float) -> GymServerError:
        """Take an instance off the list on which a call takes too long; return what to say."""
        instance_id = instance.instance_id
        why = call_too_long(
            f"A call on instance {instance_id} of {instance.env_id}",
            seconds,
            "the instance is gone",
        )
        log.warning("%s", why.message)
        self.bury(instance_id, why)
        return why

    def bury(self, instance_id: str, why: GymServerError) -> None:
        """Take an instance off the list that is not to be closed any more; keep the reason."""
        self._take_off(instance_id, why)
        # Also where it was being closed.
        self._departed.add(instance_id, why)
        self._closing.pop(instance_id, None)
        self._release(instance_id)

    def close_idle(self, minutes: float) -> None:
        """Close the instances that nobody has used or watched for so long."""
        now = time.monotonic()
        with self._lock:
            instances = list(self._instances.values())
        for instance in instances:
            hold = instance.hold
            if max(hold.used, hold.watched) > now - minutes * 60 or hold.busy_since is not None:
                continue
            if instance.screen.is_watched:
                hold.watched = now
                continue
            why = idle_closed(instance.instance_id, instance.env_id, minutes)
            if self._take_off(instance.instance_id, why) is not None:
                log.info("%s", why.message)
                closer = threading.Thread(target=self._close_and_log, args=(instance,), daemon=True)
                closer.start()

    def end_watching(self) -> None:
        """Send all watchers away: the server is about to stop."""
        with self._lock:
            instances = list(self._instances.values())
        for instance in instances:
            instance.screen.end(shutting_down())

    def close_all(self) -> None:
        """Close every instance and take no more."""
        with self._lock:
            self._stopping = True
            instances = list(self._instances.values())
            self._instances.clear()
        # One that never comes back must not keep the others from finishing their monitors.
        threads = [
            threading.Thread(target=self._close_and_log, args=(instance,), daemon=True)
            for instance in instances
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    def _new_id(self) -> str:
        while True:
            instance_id = secrets.token_hex(4)
            if instance_id not in self._instances and instance_id not in self._departed:
                return instance_id


def _processes_of(choices: EnvConfig, isolated: bool) -> int:
    """Return how many processes of its own run an environment."""
    sub_envs = choices.num_envs or 1
    return isolated + (sub_envs if choices.vectorization_mode == "async" else 0)
