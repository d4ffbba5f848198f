"""What an instance asks of whatever runs its environment."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol

from gym_server.errors import GymServerError
from gym_server.monitoring.monitor_directory import MonitorRoot
from gym_server.protocol.answers import AnswerForm, Ready
from gym_server.viewing.watchable import Moves

if TYPE_CHECKING:
    import numpy as np

Seed = int | tuple[int | tuple[int, ...] | None, ...] | None


class Backend(Protocol):
    """Runs an environment: in this process (``LocalBackend``), or in one of its own.

    Attributes:
        env_id: what the environment can be created by again.
        fps: the environment's render_fps, whatever that is.
        moves: how often the environment has begun to move; counted here.
        steps: how many steps its sub-environments have taken.
        draws_when_stepped: whether its steps run on the render thread.
        draws_on_render_thread: whether its frames are drawn on the render thread.
        grown: by how many bytes drawing has made the server's process grow.
        pids: the processes that run it, beside the server's.
        can_be_killed: whether ``kill()`` ends every call on it, so that none can be stuck.
    """

    env_id: str
    fps: object
    moves: Moves
    steps: int
    draws_when_stepped: bool
    draws_on_render_thread: bool
    can_be_killed: bool

    @property
    def grown(self) -> int:
        """See above."""

    @property
    def pids(self) -> Sequence[int]:
        """See above."""

    # Called by the thread that has the lock ------------------------------------------------

    def reset(
        self, seed: Seed, options: dict | None, form: AnswerForm, mask: np.ndarray | None
    ) -> dict | Ready:
        """Start an episode; see ``Instance.reset()``."""

    def step(self, action: object, form: AnswerForm, mask: np.ndarray | None) -> dict | Ready:
        """Take one step; see ``Instance.step()``."""

    def sample_action(self) -> object:
        """Draw an action from the action space's own generator."""

    def render(self, sub_env: int) -> np.ndarray:
        """Draw the current state of a sub-environment; see ``Instance.render()``."""

    def look(self, sub_env: int) -> tuple[dict, np.ndarray | None]:
        """Return what a watcher sees of a sub-environment; see ``Watchable.look()``."""

    def transition_model(self) -> dict | Ready:
        """Tell how the environment moves; see ``Instance.transition_model()``."""

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

    def close_monitor(self) -> None:
        """Stop recording and finish the files, if it is recorded."""

    def close(self, why: GymServerError) -> None:
        """Finish the monitor and close the environment.

        Args:
            why: the error for calls that come too late.
        """

    # Called at any time --------------------------------------------------------------------

    @property
    def action_space_info(self) -> dict:
        """The description of the action space."""

    @property
    def observation_space_info(self) -> dict:
        """The description of the observation space."""

    def action_contains(self, claim: dict) -> bool:
        """Answer a client's "contains"; see ``spaces.contains()``."""

    def observation_contains(self, claim: dict) -> bool:
        """Answer a client's "contains"; see ``spaces.contains()``."""

    def about(self) -> dict:
        """Return what is known of the environment, without waiting for it."""

    @property
    def busy_since(self) -> float | None:
        """Since when a call that needs no lock has waited, in the clock's seconds, or None."""

    def report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        """From now on report when the environment's process ends by itself, or at once if it has.

        Args:
            on_end: called with the reason.
        """

    # The end -------------------------------------------------------------------------------

    def kill(self, why: GymServerError) -> None:
        """Kill the processes that the environment runs in, if it has any of its own.

        Args:
            why: the error for the calls that this ends.
        """

    def close_abandoned(self) -> None:
        """Close what was abandoned, once the call that took too long has come back."""
