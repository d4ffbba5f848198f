"""The environments that clients made, by instance_id."""

from __future__ import annotations

import contextlib
import logging
import secrets
import threading
from collections.abc import Collection

import gymnasium
from gymnasium.vector import VectorEnv

from gym_server import creation, registry, vectorization, wrappers
from gym_server.allowed_paths import AllowedPaths
from gym_server.choices import Choices
from gym_server.errors import GymServerError, shutting_down, unknown_instance
from gym_server.frames import RenderThread
from gym_server.instance import Instance
from gym_server.vector_instance import VectorInstance

log = logging.getLogger(__name__)


class Instances:
    """All instances of a server."""

    def __init__(
        self,
        allowed_modules: Collection[str],
        renderer: RenderThread,
        max_num_envs: int = 16384,
        allowed_paths: AllowedPaths | None = None,
    ) -> None:
        """Start with none.

        Args:
            allowed_modules: names of the modules that an env_id may import.
            renderer: the process's render thread.
            max_num_envs: how many lanes one of them may have.
            allowed_paths: what clients may name of this machine's files; None for anything.
        """
        self._max_num_envs = max_num_envs
        self._allowed_paths = allowed_paths or AllowedPaths()
        self._allowed_modules = frozenset(allowed_modules)
        self._renderer = renderer
        self._lock = threading.Lock()
        self._instances: dict[str, Instance] = {}
        self._stopping = False

    def create(self, choices: Choices) -> str:
        """Make an environment and return its instance_id, 8 hex digits.

        Raises:
            GymServerError: see ``creation.make()``, ``wrappers.wrap()`` and ``Instance``;
                ``invalid_kwargs``, ``shutting_down``.
        """
        # Before an environment is made for nothing.
        self._allowed_paths.check(choices)
        wrappers.check_names(choices.wrappers)
        if choices.num_envs is None:
            vectorization.check_single(choices)
        make = self._make_single if choices.num_envs is None else self._make_vector
        with contextlib.ExitStack() as undo:
            instance = make(choices, undo)
            with self._lock:
                if self._stopping:
                    raise shutting_down()
                instance.instance_id = self._new_id()
                self._instances[instance.instance_id] = instance
            undo.pop_all()
        log.info("Made instance %s of %s", instance.instance_id, instance.env_id)
        return instance.instance_id

    def _make_single(self, choices: Choices, undo: contextlib.ExitStack) -> Instance:
        env = creation.make(
            choices.env_id, choices.render_mode, choices.kwargs or {}, self._allowed_modules
        )
        undo.callback(self._close_quietly, env)
        env = wrappers.wrap(env, choices.wrappers, self._renderer)
        return Instance(env, choices, self._renderer)

    def _make_vector(self, choices: Choices, undo: contextlib.ExitStack) -> Instance:
        env, mode = vectorization.make(
            choices, self._allowed_modules, self._max_num_envs, self._renderer
        )
        undo.callback(self._close_quietly, env)
        return VectorInstance(env, mode, choices, self._renderer)

    def _close_quietly(self, env: gymnasium.Env | VectorEnv) -> None:
        # What the client must hear of is why it gets no instance.
        with contextlib.suppress(Exception):
            self._renderer.run(env.close)

    def registered(self, search: str | None) -> list[dict]:
        """Return what can be created; see ``registry.search()``."""
        return registry.search(search, self._allowed_modules)

    def get(self, instance_id: str) -> Instance:
        """Return an instance.

        Raises:
            GymServerError: ``unknown_instance``.
        """
        try:
            return self._instances[instance_id]
        except KeyError:
            raise unknown_instance(instance_id) from None

    def env_ids(self) -> dict[str, str]:
        """Return every instance's env_id by its instance_id."""
        with self._lock:
            return {key: instance.env_id for key, instance in self._instances.items()}

    def close(self, instance_id: str) -> None:
        """Close an instance; from now on it is unknown."""
        with self._lock:
            instance = self._instances.pop(instance_id, None)
        if instance is None:
            raise unknown_instance(instance_id)
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
            if instance_id not in self._instances:
                return instance_id


def _close(instance: Instance) -> None:
    try:
        instance.close()
    except GymServerError as error:
        log.warning("Closing instance %s: %s", instance.instance_id, error)
