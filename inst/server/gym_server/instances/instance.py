"""One environment on the server, single or with sub-environments: its lock and its watchers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from gymnasium.spaces import Space

from gym_server import spaces
from gym_server.envs.config import EnvConfig
from gym_server.envs.drawing import Drawing
from gym_server.envs.make import call_env, env_id_of
from gym_server.envs.outcomes import checked_info
from gym_server.envs.transition_model import transition_model
from gym_server.envs.wrappers import time_limit
from gym_server.errors import GymServerError, invalid_parameter, reset_needed, unknown_instance
from gym_server.instances.actions import ActionReader
from gym_server.instances.episode_statistics import (
    EpisodeStatistics,
    VectorEpisodeStatistics,
)
from gym_server.instances.observations import ObservationWriter
from gym_server.json_values import plain
from gym_server.monitoring.monitor import Monitor, require_video
from gym_server.monitoring.monitor_directory import MonitorRoot, take_directory
from gym_server.protocol.answers import JSON_FORM, AnswerForm
from gym_server.rendering.png import picture
from gym_server.rendering.render_thread import RenderThread
from gym_server.threads.lock import InstanceLock
from gym_server.viewing.observation_summary import entries
from gym_server.viewing.viewer import Viewer, usable_fps

if TYPE_CHECKING:
    import numpy as np

Seed = int | tuple[int | tuple[int, ...] | None, ...] | None


class Instance:
    """An environment that a client created; ``SingleInstance`` or ``VectorInstance``.

    Every method that resets, steps or draws the environment waits for its lock. If the instance is
    closed meanwhile, the method raises ``unknown_instance``, or why it was closed. Methods that
    start with an underscore are called with the lock held.

    Attributes:
        instance_id: set when the instance is listed; "" before.
        env_id: an id that creates the same environment again.
        config: what its client chose.
        gym_env: Gymnasium's environment or vector environment.
        single_action_space: the action space of one sub-environment.
        single_observation_space: the observation space of one sub-environment.
        drawing: draws and closes the environment.
        statistics: the statistics of its episodes.
        viewer: shows it to watchers.
        steps: the number of steps of its sub-environments.
        resets_and_steps: how many resets and steps have started.
        draws_when_stepped: whether its steps run on the render thread.
        was_reset: whether an episode has begun.
        created: when it was created, in the clock's seconds.
        monitor: records its episodes, or None.
        warnings: Gymnasium's warnings about what was made.
        vectorization_mode: what runs the sub-environments; None for a single environment.
        num_workers: the number of worker processes; None for a single environment, and for the
            environment's own vector implementation.
        autoreset_mode: when a sub-environment whose episode ended is reset; None as above.
    """

    single_action_space: Space
    single_observation_space: Space
    drawing: Drawing
    statistics: EpisodeStatistics | VectorEpisodeStatistics
    monitor: Monitor | None = None
    warnings: Sequence[str] = ()
    vectorization_mode: str | None = None
    num_workers: int | None = None
    autoreset_mode: str | None = None
    draws_when_stepped: bool
    resets_and_steps = 0

    def __init__(self, env: Any, config: EnvConfig, renderer: RenderThread) -> None:
        """Take over an environment; subclasses set the spaces first.

        Raises:
            GymServerError: ``unsupported_space``.
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
        self._in_real_time = config.render_mode == "human"
        self.created = self.lock.used
        self.gym_env = env
        self.env_id = env_id_of(config, env)
        self.single_space_info = {
            "action_space": spaces.describe(self.single_action_space),
            "observation_space": spaces.describe(self.single_observation_space),
        }
        self._space_info: dict[str, dict] = {}
        self._actions = ActionReader(self.single_action_space, config.num_envs)
        is_batch = config.num_envs is not None
        self._write = ObservationWriter(self.single_observation_space, is_batch)
        self.render_fps: object = (env.metadata or {}).get("render_fps")
        self.viewer.fps = usable_fps(self.render_fps)
        self._seed_for_reset: Seed = config.seed
        self.was_reset = False
        self._observation: Any = None
        self.max_episode_steps = time_limit(env)
        if config.seed is not None:
            self._seed_actions(config.seed)

    def _seed_actions(self, seed: Seed) -> None:
        # All sub-environments share one generator.
        seeds = seed if isinstance(seed, tuple) else (seed,)
        first = next((one for one in seeds if one is not None), None)
        if first is not None:
            self.gym_env.action_space.seed(first[0] if isinstance(first, tuple) else first)

    def reset(
        self,
        seed: Seed,
        options: dict | None,
        form: AnswerForm = JSON_FORM,
        mask: np.ndarray | None = None,
    ) -> dict:
        """Start an episode in every sub-environment, or in those of a mask.

        Args:
            seed: seeds the environment and the action space; None for neither, or in the first
                reset for the seed given at creation. With sub-environments, one from which each
                derives its own, or one each.
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
        if in_real_time or self._in_real_time:
            self.viewer.pace()
        with self.lock:
            self.lock.call = "step"
            return self._step(action, form, mask)

    def sample_action(self) -> object:
        """Sample an action, for each sub-environment."""
        with self.lock:
            self.lock.call = "sample_action"
            return self._sample_action()

    def _reset(
        self, seed: Seed, options: dict | None, form: AnswerForm, mask: np.ndarray | None
    ) -> dict:
        self._check_reset(seed, options, mask)
        own_seed = self._seed_for_reset if seed is None else seed
        self.was_reset = False
        observation, info = call_env(self._begin, self._reset_env, own_seed, options, mask, form)
        if form.infos:
            checked_info(info)
        self._seed_for_reset = None
        if seed is not None and mask is None:
            self._seed_actions(seed)
        self.was_reset = True
        self.statistics.begin(mask)
        self._observation = observation
        return {
            "observation": call_env(self._write, observation, form),
            "info": call_env(plain, info) if form.infos else {},
        }

    def _check_reset(self, seed: Any, options: dict | None, mask: np.ndarray | None) -> None:
        raise NotImplementedError

    def _reset_env(
        self, seed: Any, options: dict | None, mask: np.ndarray | None, form: AnswerForm
    ) -> tuple:
        raise NotImplementedError

    def _step(self, action: object, form: AnswerForm, mask: np.ndarray | None) -> dict:
        raise NotImplementedError

    def _sample_action(self) -> object:
        raise NotImplementedError

    def _begin(self, reset_or_step: Callable[..., tuple], *args: object) -> tuple:
        """Reset or step the environment, on the render thread if it draws meanwhile."""
        self.resets_and_steps += 1
        if self.draws_when_stepped:
            return self.renderer.run(reset_or_step, *args)
        return reset_or_step(*args)

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

    def _render(self, sub_env: int) -> np.ndarray:
        if self.gym_env.render_mode != "rgb_array":
            raise GymServerError(
                "cannot_render", f"{self.env_id} draws no pictures", "see its render_modes"
            )
        if not self.was_reset:
            raise reset_needed("render()")
        frame = call_env(self.draw, sub_env)
        try:
            return picture(frame)
        except ValueError as error:
            raise GymServerError(
                "cannot_render", f"{self.env_id} does not return a picture: {error}"
            ) from error

    def draw(self, sub_env: int) -> object:
        """Draw a sub-environment; return the result unchecked."""
        raise NotImplementedError

    def look(self, sub_env: int) -> tuple[dict, np.ndarray | None]:
        """Return what a watcher sees of a sub-environment; see ``viewing.viewer.Watchable``."""
        facts = {
            "env_id": self.env_id,
            "sub_env": sub_env,
            "num_envs": self.config.num_envs,
            **self.statistics.of(sub_env),
            "reward_threshold": getattr(self.gym_env.spec, "reward_threshold", None),
            "steps": self.steps,
            "fps": self.viewer.fps if self.config.render_mode == "human" else None,
        }
        if not self.was_reset:
            return {**facts, "state": "not_reset"}, None
        try:
            return facts, self._render(sub_env)
        except GymServerError as refusal:
            reason = {"why_no_picture": refusal.message, "hint": refusal.hint}
            return {**facts, **reason, "observation": entries(self._observed(sub_env))}, None

    def _observed(self, sub_env: int) -> object:
        raise NotImplementedError

    def transition_model(self) -> dict:
        """Return ``{"model"}``, see ``envs.transition_model``.

        Raises:
            GymServerError: ``not_supported``; ``environment_error``.
        """
        self._require_single(
            f"{self.env_id} has sub-environments here, and only single environments have a "
            "transition model"
        )
        with self.lock:
            self.lock.call = "transition_model"
            return {"model": call_env(transition_model, self.gym_env, self.env_id)}

    def _require_single(self, reason: str) -> None:
        if self.config.num_envs is not None:
            raise GymServerError("not_supported", reason, "create it without num_envs")

    def space_info(self, name: str) -> dict:
        """Return the description of a space by its name, of a batched one with sub-environments."""
        # That of a large vector environment is large.
        if name not in self._space_info:
            self._space_info[name] = spaces.describe(getattr(self.gym_env, name))
        return self._space_info[name]

    def contains(self, name: str, claim: dict) -> bool:
        """Answer a client's "contains" question, with a value for each sub-environment."""
        single: Space = getattr(self, f"single_{name}")
        return spaces.contains(
            getattr(self.gym_env, name),
            claim,
            lambda value: self._decode(single, value),
            lambda: self.space_info(name),
        )

    def _decode(self, space: Space, value: object) -> object:
        """Decode JSON to a member of the space, or to one per sub-environment."""
        raise NotImplementedError

    @property
    def has_ended(self) -> bool:
        """Whether an episode ended that only the client can reset."""
        raise NotImplementedError

    def start_monitor(
        self, root: MonitorRoot, directory: str, force: bool, resume: bool, video_every: int
    ) -> None:
        """Record the episodes that start from now on; see ``Monitor`` and ``take_directory()``.

        Args:
            root: the directories that monitors may write to.
            directory: as the client sent it.
            force: whether to delete its contents.
            resume: whether to continue the numbering.
            video_every: see ``Monitor``.
        """
        self._require_single(
            f"Instance {self.instance_id} has sub-environments, and monitors record only single "
            "environments"
        )
        with self.lock:
            self.lock.call = "start_monitor"
            path = root.resolve(directory)
            if self.monitor is not None:
                raise GymServerError(
                    "monitor_active",
                    f"Instance {self.instance_id} is already monitored",
                    "close that monitor first",
                )
            if video_every:
                require_video(self.gym_env)
            taken = take_directory(path, directory, self.instance_id, force, resume)
            self.monitor = Monitor(self.gym_env, taken, video_every, lambda: self.draw(0))

    def close_monitor(self) -> None:
        """Stop recording, if active; raise ``monitor_directory`` if something was not written."""
        with self.lock:
            self.lock.call = "close_monitor"
            self._end_monitor()

    def _end_monitor(self) -> None:
        monitor, self.monitor = self.monitor, None
        if monitor is not None:
            monitor.close()

    def report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        """Report a process that ends unexpectedly, after its watchers, from now on or at once."""

    def close(self) -> None:
        """Finish the monitor and close the environment; waiting calls get an error."""
        with self.lock:
            self.lock.call = "close"
            why = self.lock.refusal()
            self.lock.closed = True
            self.viewer.end(why)
            try:
                self._end_monitor()
            finally:
                call_env(self._close_env)

    def _close_env(self) -> None:
        raise NotImplementedError
