"""One environment, its lock, and what the server knows of it."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable

import gymnasium
import numpy as np

from gym_server import spaces
from gym_server.envs import argument_limits
from gym_server.envs.config import EnvConfig
from gym_server.envs.make import ask
from gym_server.envs.wrappers import draws_when_stepped, time_limit
from gym_server.errors import GymServerError, invalid_parameter, reset_needed
from gym_server.instances.actions import ActionReader
from gym_server.instances.episode_statistics import SubEnvTally, Tally, told
from gym_server.instances.listed import Listed
from gym_server.instances.lock import Hold
from gym_server.json_values import plain
from gym_server.monitoring.monitor import Monitor
from gym_server.monitoring.monitor_directory import MonitorRoot
from gym_server.rendering.png import picture
from gym_server.rendering.render_thread import RenderThread
from gym_server.viewing.observation_summary import entries
from gym_server.viewing.viewer import Screen


class Instance(Listed):
    """One environment.

    Every method that moves the environment waits for its hold; one that waited while the
    instance was being closed raises ``unknown_instance``, or why it was closed.
    """

    def __init__(self, env: gymnasium.Env, choices: EnvConfig, renderer: RenderThread) -> None:
        """Take over an environment.

        Raises:
            GymServerError: ``unsupported_space``.
        """
        self._env = env
        self._learn_spaces()
        self._sub_env_action_space_info = spaces.describe(self._sub_env_action_space)
        self._sub_env_observation_space_info = spaces.describe(self._sub_env_observation_space)
        self._actions = ActionReader(self._sub_env_action_space, self._sub_envs)
        self._observes_tensors = spaces.travels_as_tensors(self._sub_env_observation_space)
        # Whoever reads it can create another: with the module, and with the version found.
        module, colon, name = str(choices.env_id).rpartition(":")
        self.env_id = f"{module}{colon}{env.spec.id if env.spec else name}"
        self._choices = choices
        self.renderer = renderer
        self.draws_when_stepped = self._find_out_whether_it_draws()
        self.hold = Hold(self, renderer)
        self._monitor: Monitor | None = None
        self._seed_for_reset = choices.seed
        self._was_reset = False
        self._done = False
        self._steps = 0
        self._tally = self._make_tally()
        self._observation: object = None
        self.screen = Screen(self, (env.metadata or {}).get("render_fps"))
        self._max_episode_steps = time_limit(env)
        self._for_eyes = choices.render_mode == "human"
        self._made = self.hold.used
        if choices.seed is not None:
            self._seed_actions(choices.seed)

    def _learn_spaces(self) -> None:
        self.action_space = self._sub_env_action_space = self._env.action_space
        self.observation_space = self._sub_env_observation_space = self._env.observation_space

    def _find_out_whether_it_draws(self) -> bool:
        return draws_when_stepped(self._env)

    def _make_tally(self) -> Tally | SubEnvTally:
        return Tally()

    def _seed_actions(self, seed: int | tuple[int | None, ...]) -> None:
        # One generator serves all sub-environments.
        seeds = seed if isinstance(seed, tuple) else (seed,)
        first = next((one for one in seeds if one is not None), None)
        if first is not None:
            self.action_space.seed(first)

    @property
    def action_space_info(self) -> dict:
        """The description of the action space."""
        return self._sub_env_action_space_info

    @property
    def observation_space_info(self) -> dict:
        """The description of the observation space."""
        return self._sub_env_observation_space_info

    def reset(
        self,
        seed: int | tuple[int | None, ...] | None,
        options: dict | None,
        tensors: bool = False,
        mask: np.ndarray | None = None,
    ) -> dict:
        """Start an episode.

        Args:
            seed: seeds the environment and the action space; None leaves both as they are, or
                takes the seed given at creation the first time.
            options: the environment's own.
            tensors: whether the observation is wanted as tensors.
            mask: for environments with sub-environments only.

        Returns:
            ``{"observation", "info"}`` as JSON values; the observation as ``Parts`` when tensors
            are wanted and its space can travel so.

        Raises:
            GymServerError: ``invalid_parameter``, ``not_supported``; ``environment_error``.
        """
        _refuse_mask("reset_mask", mask)
        if isinstance(seed, tuple):
            raise invalid_parameter("seed", seed, "an integer, 0 or greater")
        if self._for_eyes:
            self.screen.pace()
        argument_limits.check_reset_options(self._env, options)
        with self.hold:
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
            self._tally.begin()
            self._observation = observation
            return {
                "observation": ask(self._encode, observation, tensors),
                "info": ask(plain, info) if info else {},
            }

    def step(
        self,
        action: object,
        tensors: bool = False,
        mask: np.ndarray | None = None,
        for_eyes: bool = False,
    ) -> dict:
        """Take one step.

        Args:
            action: the JSON value of an action, or the action as ``Parts``; the bounds of a
                Box are the environment's affair.
            tensors: whether the observation is wanted as tensors.
            mask: for environments with sub-environments only.
            for_eyes: whether people want to see it: not faster than in real time, then, while
                somebody watches.

        Returns:
            ``{"observation", "reward", "done", "terminated", "truncated", "info"}`` as JSON
            values; the observation as for ``reset()``.

        Raises:
            GymServerError: ``reset_needed``, ``action_not_in_space`` or ``not_supported``, each
                before the environment moves; ``environment_error``.
        """
        _refuse_mask("step_mask", mask)
        if for_eyes or self._for_eyes:
            self.screen.pace()
        with self.hold:
            if not self._was_reset:
                raise reset_needed("step()")
            decoded = self._actions.read(action)
            try:
                return ask(self._step, decoded, tensors)
            except GymServerError as failure:
                self._actions.explain(failure, action)
                raise

    def _step(self, action: object, tensors: bool) -> dict:
        step = self._monitor.step if self._monitor else self._env.step
        observation, reward, terminated, truncated, info = self._move(step, action)
        terminated, truncated = bool(terminated), bool(truncated)
        reward = float(reward)
        self._steps += 1
        self._done = terminated or truncated
        self._tally.step(reward, self._done)
        self._observation = observation
        return {
            "observation": self._encode(observation, tensors),
            "reward": reward,
            "done": self._done,
            "terminated": terminated,
            "truncated": truncated,
            # Converted while the environment cannot change it.
            "info": plain(info) if info else {},
        }

    def _move(self, move: Callable, *args: object) -> tuple:
        self._tell_of_move()
        if self.draws_when_stepped:
            return self.renderer.run(move, *args)
        return move(*args)

    def _encode(self, observation: object, tensors: bool) -> object:
        if tensors and self._observes_tensors:
            return spaces.encode_tensors(self.observation_space, "observation", observation)
        return spaces.encode(self.observation_space, observation)

    def sample_action(self) -> object:
        """Draw an action from the action space's own generator."""
        with self.hold:
            return spaces.encode(self.action_space, self.action_space.sample())

    def action_contains(self, claim: dict) -> bool:
        """Answer a client's "contains"; see ``spaces.contains()``."""
        return spaces.contains(self.action_space, self.action_space_info, claim)

    def observation_contains(self, claim: dict) -> bool:
        """Answer a client's "contains"; see ``spaces.contains()``."""
        return spaces.contains(self.observation_space, self.observation_space_info, claim)

    def render(self, sub_env: int = 0) -> np.ndarray:
        """Draw the current state of a sub-environment; see ``png.picture()`` for the array.

        Raises:
            GymServerError: ``cannot_render``, ``reset_needed``, ``invalid_parameter``.
        """
        self.check_sub_env(sub_env)
        with self.hold:
            return self._picture(sub_env)

    def _picture(self, sub_env: int) -> np.ndarray:
        if self._env.render_mode != "rgb_array":
            raise GymServerError(
                "cannot_render", f"{self.env_id} draws no pictures", "see its render_modes"
            )
        if not self._was_reset:
            raise reset_needed("render()")
        frame = ask(self._draw, sub_env)
        try:
            return picture(frame)
        except ValueError as error:
            raise GymServerError(
                "cannot_render", f"What {self.env_id} draws is no picture: {error}"
            ) from error

    def draws_on_render_thread(self) -> bool:
        """Tell whether a picture takes the render thread."""
        return self._env.render_mode == "rgb_array"

    def _draw(self, sub_env: int) -> object:
        return self.renderer.run(self._env.render)

    def start_monitor(
        self, root: MonitorRoot, directory: str, force: bool, resume: bool, video_every: int
    ) -> None:
        """Record the episodes that start from now on; see ``Monitor``."""
        with self.hold:
            if self._monitor is not None:
                raise GymServerError(
                    "monitor_active",
                    f"Instance {self.instance_id} is already monitored",
                    "close that monitor first",
                )
            self._monitor = Monitor.start(
                self._env,
                root,
                directory,
                self.instance_id,
                force,
                resume,
                video_every,
                self.renderer,
            )

    def close_monitor(self) -> None:
        """Stop recording and finish the files, if it is recorded."""
        with self.hold:
            if self._monitor is not None:
                self._finish_monitor()

    def close(self) -> None:
        """Finish the monitor and close the environment; whoever waits learns that it is gone."""
        with self.hold:
            self.hold.closed = True
            self.screen.end(self.hold.gone())
            try:
                if self._monitor is not None:
                    self._finish_monitor()
            finally:
                ask(self._close_env)

    def condemn(self, why: GymServerError) -> int | None:
        """Give the instance up: a call on it has taken too long.

        Args:
            why: what everybody hears who waits for it.

        Returns:
            The thread that is stuck in the environment and cannot answer for itself, or None.
        """
        stuck = self.hold.condemn(why)
        self.screen.end(why)
        self._end_processes()
        if stuck is None:
            # It has just come back.
            threading.Thread(target=self._clear_away_when_free, daemon=True).start()
            return None
        return None if self.renderer.give_up(stuck, why) else stuck

    def _clear_away_when_free(self) -> None:
        with self.hold.when_free():
            self.clear_away()

    def clear_away(self) -> None:
        """Close what was condemned, once the call that took too long has come back."""
        with contextlib.suppress(BaseException):
            if self._monitor is not None:
                self._finish_monitor()
        with contextlib.suppress(BaseException):
            self._close_env()

    def _end_processes(self) -> None:
        """End the processes that the environment runs in, which ends what hangs in them."""

    def _close_env(self) -> None:
        self.renderer.run(self._env.close)

    def _finish_monitor(self) -> None:
        monitor, self._monitor = self._monitor, None
        monitor.close()

    def about(self) -> dict:
        """Return all that is known of the instance, without waiting for its environment."""
        spec = self._env.spec
        monitor = self._monitor
        return {
            **self.line(),
            "observation_space": self._sub_env_observation_space_info,
            "action_space": self._sub_env_action_space_info,
            "reward_threshold": spec.reward_threshold if spec else None,
            "max_episode_steps": self._max_episode_steps,
            "render_fps": plain((self._env.metadata or {}).get("render_fps")),
            "vectorization_mode": None,
            "autoreset_mode": None,
            "render_mode": self._choices.render_mode or self._env.render_mode,
            "kwargs": self._choices.kwargs or {},
            "wrappers": [wrapper._asdict() for wrapper in self._choices.wrappers],
            "seed": self._choices.seed,
            "episode_steps": self._tally.of(0).step,
            "needs_reset": self._done or not self._was_reset,
            "monitor": monitor.about() if monitor else None,
            "isolated": False,
        }

    def look(self, sub_env: int) -> tuple[dict, np.ndarray | None]:
        """Return what a watcher sees of a sub-environment; whoever calls it has the hold.

        Returns:
            JSON values, among them the observation where there is no picture and the reason
            why there is none; the picture or None.
        """
        facts = {
            "env_id": self.env_id,
            "sub_env": sub_env,
            "num_envs": self._num_envs,
            **told(self._tally, sub_env),
            "reward_threshold": getattr(self._env.spec, "reward_threshold", None),
            "steps": self._steps,
            "fps": self.screen.fps if self._for_eyes else None,
        }
        if not self._was_reset:
            return {**facts, "state": "not_reset"}, None
        try:
            return facts, self._picture(sub_env)
        except GymServerError as refusal:
            reason = {"why_no_picture": refusal.message, "hint": refusal.hint}
            return {**facts, **reason, "observation": entries(self._observed(sub_env))}, None

    def _observed(self, sub_env: int) -> object:
        return self._observation


def _refuse_mask(name: str, mask: np.ndarray | None) -> None:
    if mask is not None:
        raise GymServerError(
            "not_supported",
            f"'{name}' is for environments with sub-environments",
            "create it with num_envs",
        )
