"""Limits on what all clients of a server use together."""

from __future__ import annotations

from dataclasses import dataclass

from gym_server.errors import GymServerError
from gym_server.processes.cores import usable_cores


@dataclass(frozen=True)
class Limits:
    """The server's limits. The defaults protect a lab's server on one machine.

    Attributes:
        max_instances: the number of environments.
        max_num_envs: the number of sub-environments of one environment.
        max_processes: the number of processes of all environments, regardless of the number of
            cores: each takes 7 MB when it is created and 20 MB in use, two threads and 15 files,
            even when idle. Besides these, at most as many play whole episodes.
        max_call_seconds: how long a call may take; 0 for no limit.
            The default is longer than ordinary calls, and short enough that the error is there
            after a coffee break.
        idle_minutes: how long an instance may be unused and unwatched before it is evicted; 0 for
            no limit. The default is a day: work left in the evening is there in the morning.
    """

    max_instances: int = 1000
    max_num_envs: int = 100_000
    max_processes: int = 128
    max_call_seconds: float = 300.0
    idle_minutes: float = 24 * 60.0

    @property
    def rollout_processes(self) -> int:
        """How many processes play whole episodes: at most one per core."""
        return min(usable_cores(), self.max_processes)

    def check_room(self, instances: int, left: int, workers: int) -> None:
        """Refuse an environment for which there is no room.

        Args:
            instances: the number of environments.
            left: how many processes are left.
            workers: how many of them the new one takes.

        Raises:
            GymServerError: ``too_many_instances``, ``too_many_processes``.
        """
        if instances >= self.max_instances:
            raise GymServerError(
                "too_many_instances",
                f"This server has {self.max_instances} environments, the most it allows",
                "close some, GET /v1/instances/ lists them",
            )
        if workers > left:
            raise GymServerError(
                "too_many_processes",
                f"All environments together may have {self.max_processes} processes, and "
                f"{left} are left, not {workers}",
                "close some, GET /v1/instances/ lists them, or use fewer processes for sub-"
                "environments (num_workers); the server's option --max-processes sets the limit",
            )
