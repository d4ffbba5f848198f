"""What every kind of policy offers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from gym_server.policies.draws import Draws


class Actor:
    """Plays single episodes, or the episodes of a group in lockstep, a row each.

    The actions of an episode follow from its seed, its candidate and its observations; those of a
    row also from its number. Who plays the other rows changes nothing, to the last bit.

    Attributes:
        act: takes an observation, or a batch of them, as the environment gives it, and returns an
            action, or a batch of them, as the environment's ``step()`` takes it once ``clip`` has
            been applied.
        clip: returns an action, or a batch of them, cut at the bounds of the action space; None
            where ``act`` returns none beyond them. What is drawn without bounds is kept as it was
            drawn: its probability is that of the number drawn.
    """

    clip: Callable[[Any], Any] | None = None

    def __init__(self, act: Callable[[Any], Any], *draws: Draws | Actor) -> None:
        """Keep what acts, and where it takes its random numbers from."""
        self.act = act
        self._draws = draws

    def begin(self, seed: int) -> None:
        """Begin an episode, or a group of them; all that is drawn in it comes from its seed."""
        for draws in self._draws:
            draws.begin(seed)


class Policy(ABC):
    """A policy that is data, bound to an environment's spaces."""

    @property
    @abstractmethod
    def candidates(self) -> int | None:
        """How many candidates there are; None where any number acts alike."""

    @abstractmethod
    def actor(self, candidate: int | np.ndarray) -> Actor:
        """Return an actor.

        Args:
            candidate: which one plays, numbered from 0; for a group int[rows], one for each row,
                and -1 for a row whose actions nobody looks at.
        """
