"""Plays an environment in this process: what single and vector environments have in common."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from gymnasium.spaces import Space

from gym_server import spaces
from gym_server.envs.config import EnvConfig
from gym_server.envs.make import ask
from gym_server.envs.outcomes import checked_info
from gym_server.envs.transition_model import transition_model
from gym_server.envs.wrappers import time_limit
from gym_server.errors import GymServerError, reset_needed
from gym_server.instances.actions import ActionReader
from gym_server.instances.backend import Seed
from gym_server.instances.environment import Environment
from gym_server.instances.episode_statistics import facts_of
from gym_server.json_values import plain
from gym_server.monitoring.monitor import Monitor
from gym_server.monitoring.monitor_directory import MonitorRoot
from gym_server.protocol.answers import AnswerForm
from gym_server.rendering.png import picture
from gym_server.rendering.render_thread import RenderThread
from gym_server.viewing.observation_summary import entries
from gym_server.viewing.viewer import usable_fps
from gym_server.viewing.watchable import Moves

if TYPE_CHECKING:
    import numpy as np


class LocalBackend:
    """Runs an environment in this process; see ``Backend`` for the methods."""

    # Threads cannot be killed.
    can_be_killed = False
    # No call is answered without the instance knowing of it.
    busy_since = None

    def __init__(self, env: Environment, config: EnvConfig, renderer: RenderThread) -> None:
        """Take over an environment.

        Raises:
            GymServerError: ``unsupported_space``.
        """
        self.env = env
        self.env_id = env.env_id
        self._config = config
        self._renderer = renderer
        self._single_action_space_info = spaces.describe(env.single_action_space)
        self._single_observation_space_info = spaces.describe(env.single_observation_space)
        self._actions = ActionReader(env.single_action_space, config.num_envs or 1)
        self.fps: object = (env.gym_env.metadata or {}).get("render_fps")
        self.moves = Moves()
        self.steps = 0
        self.draws_when_stepped = env.draws_when_stepped
        self.draws_on_render_thread = env.draws_on_render_thread
        self._monitor: Monitor | None = None
        self._seed_for_reset: Seed = config.seed
        self._seed_bytes = 0
        self._was_reset = False
        self._observation: object = None
        self._max_episode_steps = time_limit(env.gym_env)
        if config.seed is not None:
            self._seed_actions(config.seed)

    def _seed_actions(self, seed: Seed) -> None:
        # One generator serves all sub-environments.
        seeds = seed if isinstance(seed, tuple) else (seed,)
        first = next((one for one in seeds if one is not None), None)
        if first is not None:
            self.env.action_space.seed(first[0] if isinstance(first, tuple) else first)

    # Moves ----------------------------------------------------------------------------------

    def reset(
        self, seed: Seed, options: dict | None, form: AnswerForm, mask: np.ndarray | None
    ) -> dict:
        """Start an episode; see ``Instance.reset()``."""
        env = self.env
        env.check_reset(seed, options, mask, self._was_reset)
        seed_to_use = self._seed_for_reset if seed is None else seed
        self._was_reset = False
        observation, info = ask(self._move, self._reset_env, seed_to_use, options, mask, form.infos)
        if form.infos:
            checked_info(info)
        self._seed_for_reset = None
        self._seed_bytes = _held_by(seed)
        if seed is not None and mask is None:
            self._seed_actions(seed)
        self._was_reset = True
        env.begin_episodes(mask)
        env.statistics.begin(mask)
        self._observation = observation
        return {
            "observation": ask(env.encode, observation, form),
            "info": ask(plain, info) if form.infos else {},
        }

    def _reset_env(
        self, seed: Any, options: dict | None, mask: np.ndarray | None, infos: bool
    ) -> tuple:
        if self._monitor is not None:
            return self._monitor.reset(seed=seed, options=options)
        return self.env.reset(seed, options, mask, infos)

    def step(self, action: object, form: AnswerForm, mask: np.ndarray | None) -> dict:
        """Take one step; see ``Instance.step()``."""
        if not self._was_reset:
            raise reset_needed("step()")
        which, rows = self.env.select(mask)
        decoded = self._actions.read(action, rows)
        self.env.check_running(which)
        try:
            return ask(self._step, decoded, which, form)
        except GymServerError as failure:
            if self.env.fails_as_a_whole:
                self._was_reset = False
            self._actions.explain(failure, action, rows)
            raise

    def _step(self, action: object, which: np.ndarray | None, form: AnswerForm) -> dict:
        env = self.env
        if self._monitor is not None:
            outcome = self._move(self._monitor.step, action)
        else:
            outcome = self._move(env.step, which, action, form.infos)
        observation, reward, terminated, truncated, info = outcome
        reward, terminated, truncated, done = env.read_outcome(which, reward, terminated, truncated)
        self.steps += env.count(which, reward, done)
        self._observation = observation
        return env.answer(observation, reward, terminated, truncated, done, info, form)

    def _move(self, move: Callable[..., tuple], *args: object) -> tuple:
        self.moves.begin()
        if self.draws_when_stepped:
            return self._renderer.run(move, *args)
        return move(*args)

    def sample_action(self) -> object:
        """Draw an action from the action space's own generator."""
        return self.env.encode_action(self.env.action_space.sample())

    # Looks ----------------------------------------------------------------------------------

    def render(self, sub_env: int) -> np.ndarray:
        """Draw the current state of a sub-environment; see ``Instance.render()``."""
        if self.env.gym_env.render_mode != "rgb_array":
            raise GymServerError(
                "cannot_render", f"{self.env_id} draws no pictures", "see its render_modes"
            )
        if not self._was_reset:
            raise reset_needed("render()")
        frame = ask(self.env.draw, sub_env)
        try:
            return picture(frame)
        except ValueError as error:
            raise GymServerError(
                "cannot_render", f"What {self.env_id} draws is no picture: {error}"
            ) from error

    def look(self, sub_env: int) -> tuple[dict, np.ndarray | None]:
        """Return what a watcher sees of a sub-environment; see ``Watchable.look()``."""
        facts = {
            "env_id": self.env_id,
            "sub_env": sub_env,
            "num_envs": self._config.num_envs,
            **facts_of(self.env.statistics, sub_env),
            "reward_threshold": getattr(self.env.gym_env.spec, "reward_threshold", None),
            "steps": self.steps,
            "fps": usable_fps(self.fps) if self._config.render_mode == "human" else None,
        }
        if not self._was_reset:
            return {**facts, "state": "not_reset"}, None
        try:
            return facts, self.render(sub_env)
        except GymServerError as refusal:
            reason = {"why_no_picture": refusal.message, "hint": refusal.hint}
            observation = self.env.observed(sub_env, self._observation)
            return {**facts, **reason, "observation": entries(observation)}, None

    def transition_model(self) -> dict:
        """Tell how the environment moves; see ``Instance.transition_model()``."""
        return {"model": ask(transition_model, self.env.gym_env, self.env_id)}

    # At any time ----------------------------------------------------------------------------

    @cached_property
    def action_space_info(self) -> dict:
        """The description of the action space; of a vector environment it may be large."""
        if self.env.action_space is self.env.single_action_space:
            return self._single_action_space_info
        return spaces.describe(self.env.action_space)

    @cached_property
    def observation_space_info(self) -> dict:
        """The description of the observation space; of a vector environment it may be large."""
        if self.env.observation_space is self.env.single_observation_space:
            return self._single_observation_space_info
        return spaces.describe(self.env.observation_space)

    def action_contains(self, claim: dict) -> bool:
        """Answer a client's "contains"; see ``spaces.contains()``."""
        return self._contains(self.env.single_action_space, "action_space_info", claim)

    def observation_contains(self, claim: dict) -> bool:
        """Answer a client's "contains"; see ``spaces.contains()``."""
        return self._contains(self.env.single_observation_space, "observation_space_info", claim)

    def _contains(self, space: Space, info: str, claim: dict) -> bool:
        return spaces.contains(
            claim, lambda value: self.env.decode(space, value), lambda: getattr(self, info)
        )

    def about(self) -> dict:
        """Return what is known of the environment, without waiting for it."""
        gym_env, config, monitor = self.env.gym_env, self._config, self._monitor
        spec = gym_env.spec
        single = config.num_envs is None
        return {
            "observation_space": self._single_observation_space_info,
            "action_space": self._single_action_space_info,
            "reward_threshold": spec.reward_threshold if spec else None,
            "max_episode_steps": self._max_episode_steps,
            "render_fps": plain((gym_env.metadata or {}).get("render_fps")),
            "vectorization_mode": self.env.vectorization_mode,
            "num_workers": self.env.num_workers,
            "autoreset_mode": self.env.autoreset_mode,
            "render_mode": config.render_mode or gym_env.render_mode,
            "kwargs": config.kwargs or {},
            "wrappers": [wrapper._asdict() for wrapper in config.wrappers],
            "seed": config.seed,
            "episode_steps": self.env.statistics.of(0).step if single else None,
            "needs_reset": self.env.has_ended or not self._was_reset,
            "monitor": monitor.about() if monitor else None,
            "isolated": False,
        }

    @property
    def grown(self) -> int:
        """By how many bytes drawing and seeds for later episodes have made this process grow."""
        return self.env.drawing.grown + self._seed_bytes

    @property
    def pids(self) -> Sequence[int]:
        """The processes that run it, beside this one."""
        monitor = self._monitor
        return (*self.env.pids, *(monitor.pids if monitor is not None else ()))

    def report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        """From now on report when a process of sub-environments ends by itself."""
        self.env.report_end(on_end)

    # Monitors -------------------------------------------------------------------------------

    def start_monitor(
        self,
        instance_id: str,
        root: MonitorRoot,
        directory: str,
        force: bool,
        resume: bool,
        video_every: int,
    ) -> None:
        """Record the episodes that start from now on; see ``Monitor``."""
        if self._monitor is not None:
            raise GymServerError(
                "monitor_active",
                f"Instance {instance_id} is already monitored",
                "close that monitor first",
            )
        self._monitor = Monitor.start(
            self.env.gym_env,
            root,
            directory,
            instance_id,
            force,
            resume,
            video_every,
            lambda: self.env.draw(0),
        )

    def close_monitor(self) -> None:
        """Stop recording and finish the files, if it is recorded."""
        monitor, self._monitor = self._monitor, None
        if monitor is not None:
            monitor.close()

    # The end --------------------------------------------------------------------------------

    def close(self, why: GymServerError) -> None:
        """Finish the monitor and close the environment."""
        try:
            self.close_monitor()
        finally:
            ask(self.env.close)

    def kill(self, why: GymServerError) -> None:
        """Kill the processes of sub-environments, which ends what hangs in them."""
        self.env.kill(why)

    def close_abandoned(self) -> None:
        """Close what was abandoned, once the call that took too long has come back."""
        with contextlib.suppress(BaseException):
            self.close_monitor()
        with contextlib.suppress(BaseException):
            # It may hang once more, and the watchdog looks at the render thread.
            self._renderer.run(self.env.close)


def _held_by(seed: Seed) -> int:
    """Return the bytes of the seeds for later episodes: each is an object in a list."""
    lists = [one for one in seed if isinstance(one, tuple)] if isinstance(seed, tuple) else []
    return 40 * sum(map(len, lists))
