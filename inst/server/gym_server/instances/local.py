"""Environments played in this process: the common part of single and vector environments."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from gymnasium.spaces import Space

from gym_server import spaces
from gym_server.envs.config import EnvConfig
from gym_server.envs.drawing import Drawing
from gym_server.envs.extras import engine_versions
from gym_server.envs.make import call_env
from gym_server.envs.outcomes import checked_info
from gym_server.envs.transition_model import transition_model
from gym_server.envs.wrappers import time_limit
from gym_server.errors import GymServerError, reset_needed
from gym_server.instances.actions import ActionReader
from gym_server.instances.episode_statistics import (
    EpisodeStatistics,
    VectorEpisodeStatistics,
    facts_of,
)
from gym_server.instances.instance import Instance, Seed
from gym_server.json_values import plain
from gym_server.protocol.answers import AnswerForm
from gym_server.rendering.png import picture
from gym_server.rendering.render_thread import RenderThread
from gym_server.viewing.observation_summary import entries
from gym_server.viewing.viewer import usable_fps

if TYPE_CHECKING:
    import numpy as np


class LocalInstance(Instance):
    """Plays an environment in this process.

    Attributes:
        gym_env: Gymnasium's environment or vector environment.
        drawing: draws and closes the environment.
        statistics: the statistics of its episodes.
        warnings: Gymnasium's warnings about what was made.
        vectorization_mode: what runs the sub-environments; None for a single environment.
        num_workers: the number of worker processes; None for a single environment, and for the
            environment's own vector implementation.
        autoreset_mode: when a sub-environment whose episode ended is reset; None as above.
    """

    drawing: Drawing
    statistics: EpisodeStatistics | VectorEpisodeStatistics
    warnings: Sequence[str] = ()
    vectorization_mode: str | None = None
    num_workers: int | None = None
    autoreset_mode: str | None = None

    def __init__(self, env: Any, config: EnvConfig, renderer: RenderThread) -> None:
        """Take over an environment; subclasses set the spaces first.

        Raises:
            GymServerError: ``unsupported_space``.
        """
        super().__init__(config, renderer)
        self.gym_env = env
        self.env_id = env_id_of(config, env)
        self._single_space_info = {
            "action_space": spaces.describe(self.single_action_space),
            "observation_space": spaces.describe(self.single_observation_space),
        }
        self._space_info: dict[str, dict] = {}
        self._actions = ActionReader(self.single_action_space, config.num_envs)
        self._render_fps: object = (env.metadata or {}).get("render_fps")
        self.viewer.fps = usable_fps(self._render_fps)
        self._seed_for_reset: Seed = config.seed
        self._seed_bytes = 0
        self._was_reset = False
        self._observation: Any = None
        self._max_episode_steps = time_limit(env)
        if config.seed is not None:
            self._seed_actions(config.seed)

    def _seed_actions(self, seed: Seed) -> None:
        # All sub-environments share one generator.
        seeds = seed if isinstance(seed, tuple) else (seed,)
        first = next((one for one in seeds if one is not None), None)
        if first is not None:
            self.gym_env.action_space.seed(first[0] if isinstance(first, tuple) else first)

    # Resets and steps -----------------------------------------------------------------------

    def _reset(
        self, seed: Seed, options: dict | None, form: AnswerForm, mask: np.ndarray | None
    ) -> dict:
        self._check_reset(seed, options, mask)
        seed_to_use = self._seed_for_reset if seed is None else seed
        self._was_reset = False
        observation, info = call_env(self._begin, self._reset_env, seed_to_use, options, mask, form)
        if form.infos:
            checked_info(info)
        self._seed_for_reset = None
        self._seed_bytes = _held_by(seed)
        if seed is not None and mask is None:
            self._seed_actions(seed)
        self._was_reset = True
        self.statistics.begin(mask)
        self._observation = observation
        return {
            "observation": call_env(self._encode, observation, form),
            "info": call_env(plain, info) if form.infos else {},
        }

    def _check_reset(self, seed: Any, options: dict | None, mask: np.ndarray | None) -> None:
        """Check a reset; raise ``invalid_parameter``, ``not_supported`` or ``reset_needed``."""
        raise NotImplementedError

    def _reset_env(
        self, seed: Any, options: dict | None, mask: np.ndarray | None, form: AnswerForm
    ) -> tuple:
        raise NotImplementedError

    def _begin(self, reset_or_step: Callable[..., tuple], *args: object) -> tuple:
        """Reset or step the environment, on the render thread if it draws meanwhile."""
        self.begin_reset_or_step()
        if self.draws_when_stepped:
            return self.renderer.run(reset_or_step, *args)
        return reset_or_step(*args)

    def _encode(self, observation: Any, form: AnswerForm, name: str = "observation") -> object:
        """Encode an observation, or a batch, as JSON values or ``Parts``."""
        if form.tensors and self._write_tensors:
            return self._write_tensors[name](observation, form.by_column)
        return self._write_json(self.single_observation_space, observation)

    @cached_property
    def _write_json(self) -> Callable[[Space, Any], Any]:
        # Saves the dispatch on the space for each observation.
        encode = spaces.encode if self._is_single else spaces.encode_batch
        write: Callable[[Space, Any], Any] = encode.dispatch(type(self.single_observation_space))
        return write

    @cached_property
    def _write_tensors(self) -> dict[str, Callable[[Any, bool], spaces.Parts]]:
        space = self.single_observation_space
        names = ("observation", "final_obs") if spaces.travels_as_tensors(space) else ()
        return {name: spaces.tensor_writer(space, name, not self._is_single) for name in names}

    # Looks ----------------------------------------------------------------------------------

    def _render(self, sub_env: int) -> np.ndarray:
        if self.gym_env.render_mode != "rgb_array":
            raise GymServerError(
                "cannot_render", f"{self.env_id} draws no pictures", "see its render_modes"
            )
        if not self._was_reset:
            raise reset_needed("render()")
        frame = call_env(self.draw, sub_env)
        try:
            return picture(frame)
        except ValueError as error:
            raise GymServerError(
                "cannot_render", f"{self.env_id} does not return a picture: {error}"
            ) from error

    def draw(self, sub_env: int) -> object:
        """Draw a sub-environment; return the environment's result unchecked."""
        raise NotImplementedError

    def look(self, sub_env: int) -> tuple[dict, np.ndarray | None]:
        """Return what a watcher sees of a sub-environment; see ``Watchable.look()``."""
        facts = {
            "env_id": self.env_id,
            "sub_env": sub_env,
            "num_envs": self.config.num_envs,
            **facts_of(self.statistics, sub_env),
            "reward_threshold": getattr(self.gym_env.spec, "reward_threshold", None),
            "steps": self.steps,
            "fps": self.viewer.fps if self.config.render_mode == "human" else None,
        }
        if not self._was_reset:
            return {**facts, "state": "not_reset"}, None
        try:
            return facts, self._render(sub_env)
        except GymServerError as refusal:
            reason = {"why_no_picture": refusal.message, "hint": refusal.hint}
            return {**facts, **reason, "observation": entries(self._observed(sub_env))}, None

    def _observed(self, sub_env: int) -> object:
        """Return the last observation of a sub-environment."""
        raise NotImplementedError

    def _transition_model(self) -> dict:
        return {"model": call_env(transition_model, self.gym_env, self.env_id)}

    # At any time ----------------------------------------------------------------------------

    def space_info(self, name: str) -> dict:
        """Return the description of a space, which is large for a large vector environment."""
        if name not in self._space_info:
            self._space_info[name] = spaces.describe(getattr(self.gym_env, name))
        return self._space_info[name]

    def contains(self, name: str, claim: dict) -> bool:
        """Answer a client's "contains" question; see ``Instance.contains()``."""
        space: Space = getattr(self, f"single_{name}")
        return spaces.contains(
            claim, lambda value: self._decode(space, value), lambda: self.space_info(name)
        )

    def _decode(self, space: Space, value: object) -> object:
        """Decode JSON to a member of the space, or to one per sub-environment."""
        raise NotImplementedError

    @property
    def has_ended(self) -> bool:
        """Whether an episode ended that only the client can reset."""
        raise NotImplementedError

    def _about(self) -> dict:
        spec, config = self.gym_env.spec, self.config
        return {
            "observation_space": self._single_space_info["observation_space"],
            "action_space": self._single_space_info["action_space"],
            "reward_threshold": spec.reward_threshold if spec else None,
            "max_episode_steps": self._max_episode_steps,
            "render_fps": plain(self._render_fps),
            "engine": engine_versions(spec) if spec else {},
            "warnings": list(self.warnings),
            "vectorization_mode": self.vectorization_mode,
            "num_workers": self.num_workers,
            "autoreset_mode": self.autoreset_mode,
            "render_mode": config.render_mode or self.gym_env.render_mode,
            "kwargs": config.kwargs or {},
            "wrappers": [wrapper._asdict() for wrapper in config.wrappers],
            "seed": config.seed,
            "episode_steps": None,
            "needs_reset": self.has_ended or not self._was_reset,
            "monitor": None,
        }

    @property
    def grown(self) -> int:
        """By how many bytes drawing, and seeds for later episodes, made this process grow."""
        return self.drawing.grown + self._seed_bytes

    # The end --------------------------------------------------------------------------------

    def _close(self, why: GymServerError) -> None:
        try:
            self._close_monitor()
        finally:
            call_env(self._close_env)

    def _close_env(self) -> None:
        raise NotImplementedError


def env_id_of(config: EnvConfig, gym_env: Any) -> str:
    """Return an id that creates the same environment: its module, and the version found."""
    module, colon, name = str(config.env_id).rpartition(":")
    return f"{module}{colon}{gym_env.spec.id if gym_env.spec else name}"


def _held_by(seed: Seed) -> int:
    """Return the bytes of seeds for later episodes, which are objects in lists."""
    lists = [one for one in seed if isinstance(one, tuple)] if isinstance(seed, tuple) else []
    return 40 * sum(map(len, lists))
