"""Read a policy of any kind, or a list of policies, each of which is a candidate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.spaces import Space

from gym_server.errors import GymServerError, invalid_policy
from gym_server.json_values import brief
from gym_server.policies.acting import Actor, Policy
from gym_server.policies.random import read_random
from gym_server.policies.read_network import read_network
from gym_server.policies.reading import check_fields, count_of
from gym_server.policies.table import read_table

_MOST_NUMBERS = 1_000_000
_MOST_POLICIES = 10_000

_Reader = Callable[[Mapping, Mapping[str, np.ndarray], Space, Space], Policy]

_READERS: dict[str, _Reader] = {
    "random": read_random,
    "network": read_network,
    "table": read_table,
}


def read_policy(
    document: dict,
    tensors: Mapping[str, np.ndarray],
    observation_space: Space,
    action_space: Space,
) -> Policy:
    """Read a policy, and bind it to an environment's spaces.

    Args:
        document: the policy, ``{"kind": ...}``.
        tensors: its numbers by name: "weights", "mean", "q"; in a list "0/weights" and so on.
        observation_space: the observation space.
        action_space: the action space.

    Raises:
        GymServerError: ``invalid_policy`` if it is malformed or does not fit the spaces,
            ``not_supported`` if no policy of its kind can play.
    """
    total = sum(tensor.size for tensor in tensors.values())
    if total > _MOST_NUMBERS:
        raise invalid_policy(
            f"The policy has {total:,} numbers, and at most {_MOST_NUMBERS:,} are allowed",
            "send fewer candidates at a time",
        )
    if not isinstance(document, Mapping) or document.get("kind") != "list":
        return _read_one(document, tensors, observation_space, action_space)
    documents = document.get("policies")
    if not isinstance(documents, list) or not 1 <= len(documents) <= _MOST_POLICIES:
        found = count_of(len(documents), "policy") if isinstance(documents, list) else documents
        raise invalid_policy(
            f"The policies of a list must be from 1 to {_MOST_POLICIES:,}, not {brief(found)}"
        )
    check_fields(document, {}, "policies")
    policies = []
    for index, own in enumerate(zip(documents, _by_policy(tensors, len(documents)), strict=True)):
        try:
            policies.append(_read_candidate(*own, observation_space, action_space))
        except GymServerError as error:
            raise GymServerError(
                error.code, f"Policy {index + 1} of the list: {error.message}", error.hint
            ) from None
    return PolicyList(policies)


def _read_one(
    document: object,
    tensors: Mapping[str, np.ndarray],
    observation_space: Space,
    action_space: Space,
) -> Policy:
    kind = document.get("kind") if isinstance(document, Mapping) else None
    if not isinstance(document, Mapping) or not isinstance(kind, str) or kind not in _READERS:
        raise invalid_policy(
            f"The policy must be an object whose kind is one of {', '.join(_READERS)} or list, "
            f"not {brief(document)}",
            "lists cannot be nested",
        )
    return _READERS[kind](document, tensors, observation_space, action_space)


def _read_candidate(document: object, *bound: Any) -> Policy:
    policy = _read_one(document, *bound)
    if policy.candidates not in (1, None):
        raise invalid_policy(
            f"It has {policy.candidates} candidates, but each policy of a list must be one"
        )
    return policy


def _by_policy(tensors: Mapping[str, np.ndarray], n: int) -> list[dict[str, np.ndarray]]:
    parts: list[dict[str, np.ndarray]] = [{} for _ in range(n)]
    numbers = {str(index): index for index in range(n)}
    for name, tensor in tensors.items():
        first, _, rest = name.partition("/")
        if first not in numbers:
            raise invalid_policy(
                f"The tensor {brief(name)} belongs to no policy of the list, which has "
                f"{n:,}, numbered from 0"
            )
        parts[numbers[first]][rest] = tensor
    return parts


@dataclass(frozen=True)
class PolicyList(Policy):
    """Candidates that are separate policies."""

    policies: list[Policy]

    @property
    def candidates(self) -> int:
        """The number of candidates."""
        return len(self.policies)

    def actor(self, candidate: int | np.ndarray) -> Actor:
        """Return an actor of a policy; for a group, one in which each row has its own policy.

        In a group, each policy draws for all rows and from its own generator, so that one that
        draws does not affect the draws of another.
        """
        if isinstance(candidate, int):
            return self.policies[candidate].actor(0)
        actors = {
            one: self.policies[one].actor(np.where(candidate == one, 0, -1))
            for one in np.unique(candidate[candidate >= 0]).tolist()
        }

        def act(observation: Any) -> Any:
            actions = {one: actor.act(observation) for one, actor in actors.items()}
            together = np.array(next(iter(actions.values())))
            for one, own in actions.items():
                together[candidate == one] = own[candidate == one]
            return together

        of_rows = Actor(act, *actors.values())
        # Actions of the others are within the bounds.
        of_rows.clip = next((one.clip for one in actors.values() if one.clip is not None), None)
        return of_rows
