"""One environment, its lock, and what the server knows of it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import gymnasium
import numpy as np

from gym_server import spaces
from gym_server.creation import ask
from gym_server.errors import GymServerError, unknown_instance
from gym_server.frames import RenderThread, picture
from gym_server.monitor import Monitor
from gym_server.monitor_directory import MonitorRoot
from gym_server.plain import plain
from gym_server.wrappers import Wrapper, draws_when_stepped


@dataclass(frozen=True)
class Choices:
    """What a client chose at creation."""

    env_id: object
    seed: int | None = None
    render_mode: str | None = None
    kwargs: dict | None = None
    wrappers: tuple[Wrapper, ...] = ()


class Instance:
    """One environment.

    Every method that moves the environment waits for its lock; one that waited while the
    instance was being closed raises ``unknown_instance``.
    """

    # Given when the instance is listed.
    instance_id = ""

    def __init__(self, env: gymnasium.Env, choices: Choices, renderer: RenderThread) -> None:
        """Take over an environment.

        Raises:
            GymServerError: ``unsupported_space``.
        """
        self.action_space = env.action_space
        self.observation_space = env.observation_space
        self.action_space_info = spaces.describe(self.action_space)
        self.observation_space_info = spaces.describe(self.observation_space)
        self._observes_tensors = spaces.travels_as_tensors(self.observation_space)
        # Whoever reads it can create another: with the module, and with the version found.
        module, colon, name = str(choices.env_id).rpartition(":")
        self.env_id = f"{module}{colon}{env.spec.id if env.spec else name}"
        self._env = env
        self._choices = choices
        self._renderer = renderer
        self._draws_when_stepped = draws_when_stepped(env)
        self._lock = threading.Lock()
        self._closed = False
        self._monitor: Monitor | None = None
        self._seed_for_reset = choices.seed
        self._was_reset = False
        self._done = False
        self._steps = 0
        self._episode_steps = 0
        self._made = self._used = time.monotonic()
        if choices.seed is not None:
            self.action_space.seed(choices.seed)

    def reset(self, seed: int | None, options: dict | None, tensors: bool = False) -> dict:
        """Start an episode.

        Args:
            seed: seeds the environment and the action space; None leaves both as they are, or
                takes the seed given at creation the first time.
            options: the environment's own.
            tensors: whether the observation is wanted as tensors.

        Returns:
            ``{"observation", "info"}`` as JSON values; the observation as ``Parts`` when tensors
            are wanted and its space can travel so.
        """
        with self._held():
            reset = self._monitor.reset if self._monitor else self._env.reset
            seed_to_use = self._seed_for_reset if seed is None else seed
            self._was_reset = False
            observation, info = ask(self._move, lambda: reset(seed=seed_to_use, options=options))
            if seed is None:
                self._seed_for_reset = None
            else:
                self.action_space.seed(seed)
            self._was_reset = True
            self._done = False
            self._episode_steps = 0
            return {
                "observation": ask(self._encode, observation, tensors),
                "info": ask(plain, info) if info else {},
            }

    def step(self, action: object, tensors: bool = False) -> dict:
        """Take one step.

        Args:
            action: the JSON value of a member of the action space, or the member as ``Parts``.
            tensors: whether the observation is wanted as tensors.

        Returns:
            ``{"observation", "reward", "done", "terminated", "truncated", "info"}`` as JSON
            values; the observation as for ``reset()``.

        Raises:
            GymServerError: ``reset_needed`` or ``action_not_in_space``, both before the
                environment moves; ``environment_error``.
        """
        with self._held():
            if not self._was_reset:
                raise _reset_needed("step()")
            try:
                decoded = self._decode(action)
            except spaces.NotInSpace as refusal:
                raise GymServerError("action_not_in_space", f"The action {refusal}") from None
            return ask(self._step, decoded, tensors)

    def _step(self, action: object, tensors: bool) -> dict:
        step = self._monitor.step if self._monitor else self._env.step
        observation, reward, terminated, truncated, info = self._move(step, action)
        terminated, truncated = bool(terminated), bool(truncated)
        self._steps += 1
        self._episode_steps += 1
        self._done = terminated or truncated
        return {
            "observation": self._encode(observation, tensors),
            "reward": float(reward),
            "done": self._done,
            "terminated": terminated,
            "truncated": truncated,
            # Converted while the environment cannot change it.
            "info": plain(info) if info else {},
        }

    def _move(self, move: Callable, *args: object) -> tuple:
        if self._draws_when_stepped:
            return self._renderer.run(move, *args)
        return move(*args)

    def _encode(self, observation: object, tensors: bool) -> object:
        if tensors and self._observes_tensors:
            return spaces.encode_tensors(self.observation_space, "observation", observation)
        return spaces.encode(self.observation_space, observation)

    def _decode(self, action: object) -> object:
        if isinstance(action, spaces.Parts):
            return spaces.decode_tensors(self.action_space, "action", action)
        return spaces.decode(self.action_space, action)

    def sample_action(self) -> object:
        """Draw an action from the action space's own generator."""
        with self._held():
            return spaces.encode(self.action_space, self.action_space.sample())

    def action_contains(self, claim: dict) -> bool:
        """Answer a client's "contains"; see ``spaces.contains()``."""
        return spaces.contains(self.action_space, self.action_space_info, claim)

    def observation_contains(self, claim: dict) -> bool:
        """Answer a client's "contains"; see ``spaces.contains()``."""
        return spaces.contains(self.observation_space, self.observation_space_info, claim)

    def render(self) -> np.ndarray:
        """Draw the current state; see ``frames.picture()`` for the array.

        Raises:
            GymServerError: ``cannot_render`` or ``reset_needed``.
        """
        with self._held():
            if self._env.render_mode != "rgb_array":
                raise GymServerError(
                    "cannot_render", f"{self.env_id} draws no pictures", "see its render_modes"
                )
            if not self._was_reset:
                raise _reset_needed("render()")
            frame = ask(self._renderer.run, self._env.render)
        try:
            return picture(frame)
        except ValueError as error:
            raise GymServerError(
                "cannot_render", f"What {self.env_id} draws is no picture: {error}"
            ) from error

    def start_monitor(
        self, root: MonitorRoot, directory: str, force: bool, resume: bool, video_every: int
    ) -> None:
        """Record the episodes that start from now on; see ``Monitor``."""
        with self._held():
            if self._monitor is not None:
                raise GymServerError(
                    "monitor_active",
                    f"Instance {self.instance_id} is already monitored",
                    "close that monitor first",
                )
            self._monitor = Monitor.start(
                self._env, root, directory, force, resume, video_every, self._renderer
            )

    def close_monitor(self) -> None:
        """Stop recording and finish the files.

        Raises:
            GymServerError: ``monitor_not_active``.
        """
        with self._held():
            if self._monitor is None:
                raise GymServerError(
                    "monitor_not_active", f"Instance {self.instance_id} is not monitored"
                )
            self._finish_monitor()

    def close(self) -> None:
        """Finish the monitor and close the environment; whoever waits learns that it is gone."""
        with self._held():
            self._closed = True
            try:
                if self._monitor is not None:
                    self._finish_monitor()
            finally:
                ask(self._renderer.run, self._env.close)

    def _finish_monitor(self) -> None:
        monitor, self._monitor = self._monitor, None
        monitor.close()

    def about(self) -> dict:
        """Return all that is known of the instance, without waiting for its environment."""
        spec = self._env.spec
        now = time.monotonic()
        monitor = self._monitor
        return {
            "instance_id": self.instance_id,
            "env_id": self.env_id,
            "observation_space": self.observation_space_info,
            "action_space": self.action_space_info,
            "reward_threshold": spec.reward_threshold if spec else None,
            "max_episode_steps": spec.max_episode_steps if spec else None,
            "lanes": 1,
            "render_mode": self._choices.render_mode or self._env.render_mode,
            "kwargs": self._choices.kwargs or {},
            "wrappers": [wrapper._asdict() for wrapper in self._choices.wrappers],
            "seed": self._choices.seed,
            "age_seconds": now - self._made,
            "idle_seconds": now - self._used,
            "steps": self._steps,
            "episode_steps": self._episode_steps,
            "needs_reset": self._done or not self._was_reset,
            "monitor": monitor.about() if monitor else None,
        }

    @contextmanager
    def _held(self) -> Iterator[None]:
        with self._lock:
            if self._closed:
                raise unknown_instance(self.instance_id)
            self._used = time.monotonic()
            try:
                yield
            finally:
                self._used = time.monotonic()


def _reset_needed(call: str) -> GymServerError:
    return GymServerError(
        "reset_needed", f"{call} needs a running episode", "reset the environment first"
    )
