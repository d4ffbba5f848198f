"""The memory that one creation reserves before it takes it."""

from __future__ import annotations

import math

from gym_server.budget import Budget
from gym_server.errors import GymServerError

_MB = 2**20


class TooLargeHereError(GymServerError):
    """What is being created is too large for this process, and is to be made in another one."""


class MemoryReservation:
    """What one creation takes of the budget of all environments.

    Attributes:
        taken: how many bytes that are.
    """

    def __init__(
        self, budget: Budget | None = None, num_envs: int = 1, most_here: float = math.inf
    ) -> None:
        """Start with nothing taken.

        Args:
            budget: what it takes from; None for one without a limit.
            num_envs: how many sub-environments ``reserve()`` reserves for.
            most_here: how many bytes one of them may take, to be made in this process.
        """
        self._budget = budget or Budget()
        self._num_envs = num_envs
        self._most_here = most_here
        self.taken = 0.0

    def reserve(self, size: float, what: str, later: float = 0.0) -> None:
        """Take memory for a part of each sub-environment, before that part is made.

        Args:
            size: bytes of one of them.
            what: names the part in a refusal.
            later: bytes that will be reserved later, for which there must be room already.

        Raises:
            GymServerError: ``too_much_memory``.
            TooLargeHereError: there is room for it, but not in this process.
        """
        self.take((size + later) * self._num_envs, what)
        if self.taken > self._most_here * self._num_envs:
            raise TooLargeHereError("too_much_memory", f"{what} is too large for this process")
        self.taken -= later * self._num_envs
        self._budget.give_back(later * self._num_envs)

    def take(self, size: float, what: str) -> None:
        """Take memory for all sub-environments together; see ``reserve()``."""
        if not self._budget.take(size):
            raise self._refusal(size, what)
        self.taken += size

    def give_back(self) -> None:
        """Give everything back."""
        taken, self.taken = self.taken, 0.0
        self._budget.give_back(taken)

    def _refusal(self, size: float, what: str) -> GymServerError:
        whose = f" of {self._num_envs} sub-environments" if self._num_envs > 1 else ""
        return GymServerError(
            "too_much_memory",
            f"{what}{whose} would bring this environment to {_in_mb(self.taken + size)} MiB, "
            f"estimated at its most, and {_in_mb(self._budget.left + self.taken)} MiB are left of "
            f"the {_in_mb(self._budget.limit)} MiB for all environments together",
            "fewer sub-environments or smaller observations take less; close what is not needed, "
            "GET /v1/instances/ lists it; the server's option --max-memory-mb sets the limit",
        )


def _in_mb(size: float) -> str:
    return f"{size / _MB:,.0f}" if size < 1e15 else f"{size / _MB:.1e}"
