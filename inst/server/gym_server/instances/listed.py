"""What is known of an instance whatever its environment does."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from gym_server.errors import invalid_parameter

if TYPE_CHECKING:
    from gym_server.envs.config import EnvConfig
    from gym_server.instances.lock import Hold
    from gym_server.viewing.viewer import Screen


class Listed:
    """What an instance has whatever runs its environment: its line in the list, its moves."""

    # Given when the instance is listed.
    instance_id = ""
    env_id: str
    hold: Hold
    screen: Screen
    _choices: EnvConfig
    # None where there are no sub-environments.
    _num_envs: int | None = None
    # As many as can be looked at.
    _sub_envs = 1
    _made: float
    _steps: int
    # How often the environment has begun to move, and who wants to hear of the next time.
    moves = 0
    on_move: Callable[[], None] | None = None

    def stay(self) -> None:
        """Hear that it is on the list."""

    @property
    def busy_since(self) -> float | None:
        """Since when a call has waited for it, in the clock's seconds, or None."""
        return self.hold.busy_since

    def check_sub_env(self, sub_env: int) -> None:
        """Raise ``invalid_parameter`` for a sub-environment that there is not."""
        if sub_env >= self._sub_envs:
            last = f"an integer from 0 to {self._sub_envs - 1}" if self._sub_envs > 1 else "0"
            raise invalid_parameter("sub_env", sub_env, f"{last} for this environment")

    def line(self) -> dict:
        """Return its line in the list."""
        now = time.monotonic()
        return {
            "instance_id": self.instance_id,
            "env_id": self.env_id,
            "name": self._choices.name,
            "num_envs": self._num_envs,
            "age_seconds": now - self._made,
            "idle_seconds": now - self.hold.used,
            "steps": self._steps,
            "watched": self.screen.is_watched,
        }

    def _tell_of_move(self) -> None:
        """Count a move that begins, for those who watch."""
        self.moves += 1
        if self.on_move is not None:
            call, self.on_move = self.on_move, None
            call()
