"""Act by a table with a row per state and a column per action."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.spaces import Discrete, Space

from gym_server.errors import GymServerError, invalid_policy
from gym_server.json_values import brief
from gym_server.policies.acting import Actor, Policy
from gym_server.policies.discrete import DiscreteChoice
from gym_server.policies.reading import (
    above_zero,
    check_fields,
    count_of,
    epsilon_of,
    numbers,
    shape_text,
)
from gym_server.policies.states import NOT_A_STATE, States, states_of
from gym_server.spaces import brief_space
from gym_server.spaces.stacking import unstack


@dataclass(frozen=True)
class TablePolicy(Policy):
    """Takes the action with the largest value, and may explore.

    Attributes:
        q: float64[candidates, states, actions].
        states: the numbering of the rows.
        observation_space: the observation space.
        choice: chooses an action by its values.
    """

    q: np.ndarray
    states: States
    observation_space: Space
    choice: DiscreteChoice

    @property
    def candidates(self) -> int:
        """The number of tables."""
        return len(self.q)

    def actor(self, candidate: int | np.ndarray) -> Actor:
        """Return an actor that looks up the values of a state; see ``Policy.actor()``."""
        q, rows = self.q, np.shape(candidate)

        def values_of(observation: Any) -> np.ndarray:
            state = self._indices(observation) if rows else self._index(observation)
            values: np.ndarray = q[candidate, state].T
            lacks_action = values.max(axis=0) == -np.inf
            if np.any(lacks_action):
                raise _no_action(int(np.extract(lacks_action, state)[0]))
            return values

        return self.choice.actor(values_of, rows, remembers=not rows)

    def _indices(self, batch: Any) -> np.ndarray:
        return np.array([self._index(one) for one in unstack(self.observation_space, batch)])

    def _index(self, observation: Any) -> int:
        try:
            return self.states.index(observation)
        except NOT_A_STATE:
            raise invalid_policy(
                f"The policy's table has no row for the observation {brief(observation)}",
                "the environment's observation is not in its observation space",
            ) from None


def _no_action(state: int) -> GymServerError:
    return invalid_policy(
        f"Row {state + 1} of the policy's table leaves no action: all its values are -Inf",
        "give at least one action of each state a value",
    )


def read_table(
    document: Mapping,
    tensors: Mapping[str, np.ndarray],
    observation_space: Space,
    action_space: Space,
) -> TablePolicy:
    """Read a table, which must have a row per state and a column per action."""
    check_fields(document, tensors, "q", "epsilon", "temperature")
    if not isinstance(action_space, Discrete):
        raise GymServerError(
            "not_supported",
            f"A table cannot have a column for each action of {brief_space(action_space)}",
            "tables need a Discrete action space",
        )
    states = states_of(observation_space)
    if states is None:
        raise GymServerError(
            "not_supported",
            f"A table needs observations that can be counted, and "
            f"{brief_space(observation_space)} cannot",
            "Discrete, MultiDiscrete and MultiBinary can, and a Tuple or Dict of these",
        )
    epsilon, temperature = epsilon_of(document) or 0.0, above_zero(document, "temperature")
    q = numbers(tensors, "q")
    shape = (states.count, int(action_space.n))
    if q.shape[-2:] != shape or q.ndim not in (2, 3) or not q.size:
        raise invalid_policy(
            f"The policy's q must be a table of {count_of(shape[0], 'state')} and "
            f"{count_of(shape[1], 'action')}, or one for each candidate, not {shape_text(q.shape)}"
        )
    if np.isnan(q).any():
        raise invalid_policy("The policy's q must be numbers, not NaN")
    if temperature is not None and (q == np.inf).any():
        raise invalid_policy("The policy's q must not be Inf with a temperature")
    choice = DiscreteChoice(action_space, epsilon, temperature, masks=True)
    return TablePolicy(q.reshape(-1, *shape), states, observation_space, choice)
