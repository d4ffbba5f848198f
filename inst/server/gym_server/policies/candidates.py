"""A list of policies of any kind, each of which is a candidate."""

from __future__ import annotations

from typing import Any

import numpy as np

from gym_server.policies.acting import Actor, GroupActor, Policy


class PolicyList(Policy):
    """Candidates that are policies of their own."""

    def __init__(self, policies: list[Policy]) -> None:
        self.candidates = len(policies)
        self._policies = policies

    def actor(self, candidate: int) -> Actor:
        """Return an actor of one of the policies."""
        return self._policies[candidate].actor(0)

    def group_actor(self, candidates: np.ndarray, num_envs: int) -> GroupActor:
        """Return an actor in which each policy acts for all rows, and each row takes its own.

        Each policy draws from a generator of its own, so that one that draws does not move the
        draws of another.
        """
        parts: list[tuple[np.ndarray, GroupActor]] = []
        for candidate in np.unique(candidates).tolist():
            actor = self._policies[candidate].group_actor(np.zeros(num_envs, np.intp), num_envs)
            parts.append((np.flatnonzero(candidates == candidate), actor))

        def act(observation: Any) -> np.ndarray:
            actions = [actor.act(observation) for _, actor in parts]
            together = np.array(actions[0])
            for (rows, _), own in zip(parts, actions, strict=True):
                together[rows] = own[rows]
            return together

        return GroupActor(act, *(actor for _, actor in parts))
