"""The environments that clients made, by instance_id."""

from __future__ import annotations

import contextlib
import logging
import secrets
import threading
from collections.abc import Collection
from itertools import islice

from gym_server import registry, vectorization, wrappers
from gym_server.choices import Choices
from gym_server.errors import GymServerError, shutting_down, unknown_instance
from gym_server.frames import RenderThread
from gym_server.instance import Instance
from gym_server.isolated_instance import IsolatedInstance
from gym_server.isolation import Isolation
from gym_server.making import make

log = logging.getLogger(__name__)

# Why instances ended that nobody closed.
_KEPT_REASONS = 10_000


class Instances:
    """All instances of a server."""

    def __init__(
        self,
        allowed_modules: Collection[str],
        renderer: RenderThread,
        max_num_envs: int = 16384,
        isolation: Isolation | None = None,
    ) -> None:
        """Start with none.

        Args:
            allowed_modules: names of the modules that an env_id may import.
            renderer: the process's render thread.
            max_num_envs: how many lanes one of them may have.
            isolation: which of them get a process of their own; None for none.
        """
        self._isolation = isolation or Isolation()
        self._max_num_envs = max_num_envs
        self._allowed_modules = frozenset(allowed_modules)
        self._renderer = renderer
        self._lock = threading.Lock()
        self._instances: dict[str, Instance | IsolatedInstance] = {}
        self._gone: dict[str, GymServerError] = {}
        self._stopping = False

    def create(self, choices: Choices) -> str:
        """Make an environment and return its instance_id, 8 hex digits.

        Raises:
            GymServerError: see ``making.make()``; ``shutting_down``, ``environment_died``.
        """
        # Before an environment is made for nothing.
        wrappers.check_names(choices.wrappers)
        if choices.num_envs is None:
            vectorization.check_single(choices)
        isolated = self._isolation.wants(choices.env_id, self._allowed_modules)
        with contextlib.ExitStack() as undo:
            instance = self._make_isolated(choices, undo) if isolated else self._make(choices, undo)
            with self._lock:
                if self._stopping:
                    raise shutting_down()
                instance.instance_id = self._new_id()
                self._instances[instance.instance_id] = instance
            undo.pop_all()
        log.info("Made instance %s of %s", instance.instance_id, instance.env_id)
        return instance.instance_id

    def _make(self, choices: Choices, undo: contextlib.ExitStack) -> Instance:
        return make(choices, self._allowed_modules, self._max_num_envs, self._renderer, undo)

    def _make_isolated(self, choices: Choices, undo: contextlib.ExitStack) -> IsolatedInstance:
        surroundings = self._isolation.surroundings(
            choices.env_id, self._allowed_modules, self._max_num_envs
        )
        instance = IsolatedInstance(
            choices, surroundings, lambda one, why: self.bury(one.instance_id, why)
        )
        undo.callback(instance.condemn, shutting_down())
        instance.create()
        return instance

    def registered(self, search: str | None) -> list[dict]:
        """Return what can be created; see ``registry.search()``."""
        if self._isolation.mode != "none" and self._allowed_modules:
            return self._isolation.search(search, self._allowed_modules)
        return registry.search(search, self._allowed_modules)

    def get(self, instance_id: str) -> Instance | IsolatedInstance:
        """Return an instance.

        Raises:
            GymServerError: ``unknown_instance``, or why it is gone.
        """
        try:
            return self._instances[instance_id]
        except KeyError:
            raise self._reason(instance_id) from None

    def _reason(self, instance_id: str) -> GymServerError:
        why = self._gone.get(instance_id)
        return why.again() if why else unknown_instance(instance_id)

    def bury(self, instance_id: str, why: GymServerError) -> None:
        """Forget an instance that is gone; later calls get the reason."""
        with self._lock:
            if self._instances.pop(instance_id, None) is None:
                return
            self._gone[instance_id] = why
            for oldest in list(islice(self._gone, max(0, len(self._gone) - _KEPT_REASONS))):
                del self._gone[oldest]

    def env_ids(self) -> dict[str, str]:
        """Return every instance's env_id by its instance_id."""
        with self._lock:
            return {key: instance.env_id for key, instance in self._instances.items()}

    def close(self, instance_id: str) -> None:
        """Close an instance; from now on it is unknown."""
        with self._lock:
            instance = self._instances.pop(instance_id, None)
        if instance is None:
            raise self._reason(instance_id)
        instance.close()
        log.info("Closed instance %s", instance_id)

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
            threading.Thread(target=_close, args=(instance,), daemon=True) for instance in instances
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    def _new_id(self) -> str:
        while True:
            instance_id = secrets.token_hex(4)
            if instance_id not in self._instances and instance_id not in self._gone:
                return instance_id


def _close(instance: Instance | IsolatedInstance) -> None:
    try:
        instance.close()
    except GymServerError as error:
        log.warning("Closing instance %s: %s", instance.instance_id, error)
