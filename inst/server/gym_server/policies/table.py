"""Act by a table with a row for each state and a column for each action."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from gymnasium.spaces import Discrete, Space

from gym_server.errors import GymServerError, invalid_policy
from gym_server.json_values import brief
from gym_server.policies.acting import Actor, GroupActor, Policy
from gym_server.policies.choice import (
    Odds,
    draw_columns,
    even_columns,
    odds,
    softmax_columns,
    softmax_weights,
)
from gym_server.policies.draws import EpisodeGenerator, uniforms
from gym_server.policies.fields import (
    check_fields,
    count_of,
    epsilon_of,
    numbers,
    shape_text,
    temperature_of,
)
from gym_server.policies.memo import remembered
from gym_server.policies.outputs import members_of
from gym_server.policies.states import States, states_of
from gym_server.spaces import brief_space

# What the number of a state is asked by; see ``States``.
_NOT_A_STATE = (ValueError, TypeError, KeyError, IndexError)


class TablePolicy(Policy):
    """Takes the action with the largest value, and may explore."""

    def __init__(
        self,
        q: np.ndarray,
        states: States,
        action_space: Discrete,
        epsilon: float,
        temperature: float | None,
    ) -> None:
        """Keep the table.

        Args:
            q: float64[candidates, states, actions].
            states: what its rows are for.
            action_space: what its columns are for.
            epsilon: how often any other action is drawn.
            temperature: of the softmax that actions are drawn by, in place of epsilon; None for
                none.
        """
        self.candidates = len(q)
        self._q = q
        self._states = states
        self._space = action_space
        self._epsilon = epsilon
        self._temperature = temperature

    def actor(self, candidate: int) -> Actor:
        """Return an actor that looks its states up in a candidate's table."""
        rows = self._rows(self._q[candidate])
        members = members_of(self._space)
        if self._temperature is not None:
            return _by_odds(rows, members, self._temperature)
        if self._epsilon > 0:
            return _exploring(rows, members, self._epsilon)
        return Actor(remembered(lambda observation: members[_best(rows(observation))]))

    def group_actor(self, candidates: np.ndarray, num_envs: int) -> GroupActor:
        """Return an actor that looks the states of all rows up."""
        start, dtype = int(self._space.start), self._space.dtype
        generator = EpisodeGenerator()

        def act(observation: Any) -> np.ndarray:
            states = self._indices(observation)
            columns = self._q[candidates, states].T
            if (columns.max(axis=0) == -np.inf).any():
                raise _no_action(int(states[columns.max(axis=0) == -np.inf][0]))
            return (self._chosen(columns, generator) + start).astype(dtype)

        return GroupActor(act, generator)

    def _chosen(self, columns: np.ndarray, generator: EpisodeGenerator) -> np.ndarray:
        n = columns.shape[1]
        if self._temperature is not None:
            return draw_columns(softmax_columns(columns, self._temperature), generator.uniforms(n))
        choice: np.ndarray = columns.argmax(axis=0)
        if self._epsilon == 0:
            return choice
        explores, u = generator.uniforms(2, n)
        drawn = draw_columns(even_columns(columns > -np.inf), u)
        return np.where(explores < self._epsilon, drawn, choice)

    def _rows(self, q: np.ndarray) -> Callable[[Any], list[float]]:
        index = self._states.index

        def row(observation: Any) -> list[float]:
            try:
                state = index(observation)
            except _NOT_A_STATE:
                raise _no_row(observation) from None
            values: list[float] = q[state].tolist()
            if max(values) == -np.inf:
                raise _no_action(state)
            return values

        return row

    def _indices(self, observation: Any) -> np.ndarray:
        try:
            return self._states.indices(observation)
        except _NOT_A_STATE:
            raise _no_row(observation) from None


def _best(values: list[float]) -> int:
    return values.index(max(values))


def _by_odds(rows: Callable[[Any], list[float]], members: list[Any], temperature: float) -> Actor:
    draws = uniforms()
    take = draws.take
    find = remembered(lambda observation: odds(softmax_weights(rows(observation), temperature)))

    def act(observation: Any) -> Any:
        return members[find(observation).draw(take())]

    return Actor(act, draws)


def _exploring(rows: Callable[[Any], list[float]], members: list[Any], epsilon: float) -> Actor:
    draws = uniforms()
    take = draws.take

    def best_and_possible(observation: Any) -> tuple[int, Odds]:
        values = rows(observation)
        return _best(values), odds([float(value > -np.inf) for value in values])

    find = remembered(best_and_possible)

    def act(observation: Any) -> Any:
        best, possible = find(observation)
        return members[possible.draw(take()) if take() < epsilon else best]

    return Actor(act, draws)


def _no_row(observation: Any) -> GymServerError:
    return invalid_policy(
        f"The policy's table has no row for the observation {brief(observation)}",
        "the environment's observation is not in its observation space",
    )


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
    """Read a table, which must have a row for each state and a column for each action."""
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
    epsilon, temperature = epsilon_of(document, 0.0), temperature_of(document)
    q = _table_of(numbers(tensors, "q"), states.count, int(action_space.n))
    if temperature is not None and (q == np.inf).any():
        raise invalid_policy("The policy's q has the value Inf, of which there is no softmax")
    return TablePolicy(q, states, action_space, epsilon or 0.0, temperature)


def _table_of(q: np.ndarray, states: int, actions: int) -> np.ndarray:
    if np.isnan(q).any():
        raise invalid_policy("The policy's q must be numbers, not NaN")
    tables = q[np.newaxis] if q.ndim == 2 else q
    if tables.ndim != 3 or not len(tables):
        raise invalid_policy(
            f"The policy's q must be a table or one for each candidate, not {shape_text(q.shape)}"
        )
    if tables.shape[1:] != (states, actions):
        rows, columns = tables.shape[1:]
        raise invalid_policy(
            f"The policy's table has {count_of(rows, 'row')} and {count_of(columns, 'column')}, "
            f"but the environment has {count_of(states, 'state')} and "
            f"{count_of(actions, 'action')}"
        )
    return tables
