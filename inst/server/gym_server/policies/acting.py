"""The interface of every kind of policy."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from gym_server.policies.draws import Draws


class Actor:
    """Plays single episodes, or the episodes of a group in lockstep, one per row.

    The actions of an episode depend only on its seed, candidate and observations, and in a group on
    its row number. The other rows do not affect them, to the last bit.

    Attributes:
        act: takes an observation, or a batch, from the environment, and returns an action, or a
            batch, for its ``step()`` after ``clip`` is applied.
        clip: clips an action, or a batch, to the bounds of the action space; None if ``act``
            returns none beyond them. An action drawn without bounds is kept as drawn, because its
            probability is that of the drawn number.
    """

    clip: Callable[[Any], Any] | None = None

    def __init__(self, act: Callable[[Any], Any], *draws: Draws | Actor) -> None:
        """Keep the function that acts, and its sources of random numbers."""
        self.act = act
        self._draws = draws

    def begin(self, seed: int) -> None:
        """Start an episode, or a group; its seed determines all its draws."""
        for draws in self._draws:
            draws.begin(seed)


class Policy(ABC):
    """A policy that is sent as data, bound to an environment's spaces."""

    @property
    @abstractmethod
    def candidates(self) -> int | None:
        """The number of candidates; None if all act alike."""

    @abstractmethod
    def actor(self, candidate: int | np.ndarray) -> Actor:
        """Return an actor.

        Args:
            candidate: the candidate that plays, from 0. For a group int[rows], one per row, and -1
                for a row whose actions are not used.
        """
