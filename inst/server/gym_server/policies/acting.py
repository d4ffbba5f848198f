"""What every kind of policy offers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np


class Seeded(Protocol):
    """What is told the seed of each episode, or of each group of episodes."""

    def begin(self, seed: int) -> None:
        """Forget what was drawn, and draw from this seed from now on."""


class Actor:
    """Plays one episode at a time by one candidate.

    Attributes:
        act: takes an observation as the environment gives it, and returns an action as the
            environment's ``step()`` takes it.
    """

    def __init__(self, act: Callable[[Any], Any], *draws: Seeded) -> None:
        """Keep what acts.

        Args:
            act: see above.
            draws: where ``act`` takes its random numbers from.
        """
        self.act = act
        self._draws = draws

    def begin(self, seed: int) -> None:
        """Begin an episode; all that is drawn in it comes from its seed."""
        for draws in self._draws:
            draws.begin(seed)


class GroupActor(Actor):
    """Plays the episodes of a group in lockstep, a row each.

    The actions of a row follow from the group's seed, the row's number, its candidate and its
    observations. Who plays the other rows changes nothing, to the last bit.

    Attributes:
        act: takes the observations of all rows, and returns their actions, both as a vector
            environment of Gymnasium has them.
    """


class Policy(ABC):
    """A policy that is data, bound to an environment's spaces.

    Attributes:
        candidates: how many candidates there are; None where any number acts alike.
    """

    candidates: int | None

    @abstractmethod
    def actor(self, candidate: int) -> Actor:
        """Return an actor that plays episodes by a candidate, numbered from 0."""

    @abstractmethod
    def group_actor(self, candidates: np.ndarray, num_envs: int) -> GroupActor:
        """Return an actor that plays groups.

        Args:
            candidates: int[num_envs], the candidate that plays each row.
            num_envs: how many rows there are.
        """
