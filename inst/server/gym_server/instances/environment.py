"""What is different about single environments and vector environments, behind one interface."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from gymnasium.spaces import Space

from gym_server.envs.config import EnvConfig
from gym_server.envs.drawing import Drawing
from gym_server.errors import GymServerError
from gym_server.instances.episode_statistics import Statistics
from gym_server.protocol.answers import AnswerForm

if TYPE_CHECKING:
    import numpy as np


class Environment(Protocol):
    """An environment in this process, as ``LocalBackend`` plays it.

    Attributes:
        env_id: what it can be created by again.
        gym_env: Gymnasium's environment.
        action_space: of a whole action, for all sub-environments together.
        observation_space: of a whole observation.
        single_action_space: of an action of one sub-environment.
        single_observation_space: of an observation of one sub-environment.
        statistics: of its episodes.
        vectorization_mode: what runs the sub-environments; None for a single environment.
        num_workers: how many processes run them; None for a single environment, and for an
            implementation of the environment's own.
        autoreset_mode: what becomes of a sub-environment whose episode ended; None as above.
        draws_when_stepped: whether its steps must run on the render thread.
        draws_on_render_thread: whether ``draw()`` uses the render thread.
        drawing: how it is drawn, and closed.
        pids: the processes that run it, beside this one.
        fails_as_a_whole: whether it needs a reset after a step that failed.
    """

    env_id: str
    gym_env: Any
    action_space: Space
    observation_space: Space
    single_action_space: Space
    single_observation_space: Space
    statistics: Statistics
    vectorization_mode: str | None
    num_workers: int | None
    autoreset_mode: str | None
    draws_when_stepped: bool
    draws_on_render_thread: bool
    drawing: Drawing
    fails_as_a_whole: bool

    @property
    def pids(self) -> Sequence[int]:
        """See above."""

    # Reset ---------------------------------------------------------------------------------

    def check_reset(
        self, seed: Any, options: dict | None, mask: np.ndarray | None, was_reset: bool
    ) -> None:
        """Raise ``invalid_parameter``, ``not_supported`` or ``reset_needed`` before a reset."""

    def reset(self, seed: Any, options: dict | None, mask: np.ndarray | None, infos: bool) -> tuple:
        """Reset the environment, or the sub-environments of a mask; see ``step()`` for infos."""

    def begin_episodes(self, mask: np.ndarray | None) -> None:
        """Remember that episodes have begun, in the sub-environments of a mask."""

    # Step ----------------------------------------------------------------------------------

    def select(self, mask: np.ndarray | None) -> tuple[np.ndarray | None, int | None]:
        """Return which sub-environments a mask selects, and how many actions they take.

        None stands for all of them, and for the one action of a single environment.

        Raises:
            GymServerError: ``invalid_parameter``, ``not_supported``.
        """

    def check_running(self, which: np.ndarray | None) -> None:
        """Raise ``reset_needed`` when sub-environments ended that do not reset themselves."""

    def step(self, which: np.ndarray | None, action: Any, infos: bool) -> tuple:
        """Step the environment, or the sub-environments that ``select()`` returned.

        Args:
            which: the sub-environments.
            action: one, or one for each.
            infos: whether somebody wants the infos; where it saves work, none are made then.
        """

    def read_outcome(
        self, which: np.ndarray | None, reward: Any, terminated: Any, truncated: Any
    ) -> tuple[Any, Any, Any, Any]:
        """Return reward, terminated, truncated and done in their types; remember the last."""

    def count(self, which: np.ndarray | None, reward: Any, done: Any) -> int:
        """Count a step in the statistics, and return how many sub-environments took part in it."""

    def answer(
        self,
        observation: object,
        reward: Any,
        terminated: Any,
        truncated: Any,
        done: Any,
        info: dict,
        form: AnswerForm,
    ) -> dict:
        """Return the answer to a step, as JSON values or with ``Parts``."""

    # Values --------------------------------------------------------------------------------

    def encode(self, observation: Any, form: AnswerForm) -> object:
        """Return an observation as a JSON value or as ``Parts``."""

    def encode_action(self, action: Any) -> object:
        """Return an action as a JSON value."""

    def decode(self, space: Space, value: object) -> object:
        """Return the member of a space, or one for each sub-environment, that JSON stands for.

        Args:
            space: of one sub-environment.
            value: the JSON value.

        Raises:
            NotInSpace: there is none.
        """

    @property
    def has_ended(self) -> bool:
        """Whether an episode ended that only a reset of the client's follows."""

    def observed(self, sub_env: int, observation: Any) -> object:
        """Return the last observation of a sub-environment, given that of the last move."""

    def draw(self, sub_env: int) -> object:
        """Draw a sub-environment; return whatever the environment draws."""

    # The end -------------------------------------------------------------------------------

    def close(self) -> None:
        """Close it."""

    def report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        """From now on report when a process that it runs in ends by itself, or if it has."""

    def kill(self, why: GymServerError) -> None:
        """Kill the processes that it runs in, if it has any; the reason is for calls that wait."""


def env_id_of(config: EnvConfig, gym_env: Any) -> str:
    """Return what an environment can be created by again: its module, and the version found."""
    module, colon, name = str(config.env_id).rpartition(":")
    return f"{module}{colon}{gym_env.spec.id if gym_env.spec else name}"
