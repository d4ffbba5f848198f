"""The memory that creating an environment reserves in advance."""

from __future__ import annotations

from gym_server.budget import Budget
from gym_server.errors import GymServerError

_MB = 2**20


class MemoryReservation:
    """The share of the memory budget that one creation takes.

    Attributes:
        taken: the bytes taken so far.
    """

    def __init__(self, budget: Budget | None = None, num_envs: int = 1) -> None:
        """Start with nothing taken.

        Args:
            budget: the budget; None for no limit.
            num_envs: how many sub-environments ``reserve()`` reserves for.
        """
        self._budget = budget or Budget()
        self._num_envs = num_envs
        self.taken = 0.0

    def reserve(self, size: float, what: str, later: float = 0.0) -> None:
        """Take memory for a part of each sub-environment, before that part is made.

        Args:
            size: the bytes for one sub-environment.
            what: the part's name in an error.
            later: bytes to be reserved later, which must already be available.

        Raises:
            GymServerError: ``too_much_memory``.
        """
        self.take((size + later) * self._num_envs, what)
        self.taken -= later * self._num_envs
        self._budget.give_back(later * self._num_envs)

    def take(self, size: float, what: str) -> None:
        """Take memory for all sub-environments at once; see ``reserve()``."""
        if not self._budget.take(size):
            raise self._refusal(size, what)
        self.taken += size

    def give_back(self) -> None:
        """Return everything to the budget."""
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
