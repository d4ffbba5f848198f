"""The transition model of an environment with a table of it, such as Gymnasium's toy-text ones.

The table is the attribute ``P``: ``P[state][action]`` lists ``(probability, next_state, reward,
terminated)``. The attribute ``initial_state_distrib`` holds the probability that an episode starts
in each state.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from typing import Any

import gymnasium
from gymnasium.spaces import Discrete

from gym_server.envs.wrappers import changing_wrapper
from gym_server.errors import GymServerError
from gym_server.json_values import brief

_COLUMNS = ("state", "action", "next_state", "probability", "reward", "terminated")


def transition_model(env: gymnasium.Env, env_id: str) -> dict:
    """Return the transition model of an environment, without its time limit.

    Args:
        env: the environment, with its wrappers.
        env_id: its name, for errors.

    Returns:
        ``{"num_states", "num_actions", "start", "state", "action", "next_state", "probability",
        "reward", "terminated"}``, all Python numbers: the number of states and actions; the
        probability of starting in each state; and columns with one element per transition with a
        probability above 0, sorted by state, action, and position in the table.

    Raises:
        GymServerError: ``not_supported``.
    """
    base = env.unwrapped
    table = getattr(base, "P", None)
    start = getattr(base, "initial_state_distrib", None)
    num_states, num_actions = _size(base.observation_space), _size(base.action_space)
    if not isinstance(table, dict) or start is None or not num_states or not num_actions:
        raise GymServerError(
            "not_supported",
            f"{env_id} has no table of its transitions",
            "FrozenLake, CliffWalking and Taxi have one, and so does every environment with the "
            "attributes P and initial_state_distrib and Discrete spaces that start at 0",
        )
    _check_table_holds(env, env_id)
    try:
        first = _start(start, num_states)
        transitions = zip(*_transitions(table, num_states, num_actions), strict=True)
        columns = dict(zip(_COLUMNS, map(list, transitions), strict=True))
    except _UnsoundError as fault:
        raise GymServerError(
            "not_supported",
            f"The transition table of {env_id} is invalid: {fault}",
            "P[state][action] must list (probability, next_state, reward, terminated); the "
            "environment's arguments may be the cause",
        ) from None
    return {"num_states": num_states, "num_actions": num_actions, "start": first, **columns}


def _size(space: gymnasium.Space) -> int:
    """Return the number of members of a Discrete space that starts at 0; 0 for other spaces."""
    return int(space.n) if isinstance(space, Discrete) and space.start == 0 else 0


def _check_table_holds(env: gymnasium.Env, env_id: str) -> None:
    """Refuse an environment whose transitions differ from its table."""
    wrapper = changing_wrapper(env)
    if wrapper is not None:
        raise GymServerError(
            "not_supported",
            f"The transition table of {env_id} is wrong with its wrapper {wrapper}",
            "create it without this wrapper; TimeLimit and RecordEpisodeStatistics are allowed",
        )
    # Taxi's passenger may change the destination after a move, and whether this will happen is not
    # part of the state.
    if getattr(env.unwrapped, "fickle_passenger", False):
        raise GymServerError(
            "not_supported",
            f"The transition table of {env_id} is wrong with fickle_passenger",
            "create it without fickle_passenger",
        )


class _UnsoundError(Exception):
    """A table is not a valid transition model."""


def _start(distribution: Any, num_states: int) -> list[float]:
    with contextlib.suppress(*_NO_NUMBERS):
        start = [float(probability) for probability in distribution]
        if len(start) == num_states and all(0 <= probability <= 1 for probability in start):
            return start
    raise _UnsoundError(
        f"initial_state_distrib must hold a probability for each of the {num_states} states"
    )


def _transitions(table: dict, num_states: int, num_actions: int) -> Iterator[tuple]:
    for state in range(num_states):
        for action in range(num_actions):
            name = f"P[{state}][{action}]"
            try:
                outcomes = table[state][action]
            except (LookupError, TypeError):
                outcomes = None
            if not isinstance(outcomes, (list, tuple)) or not outcomes:
                raise _UnsoundError(f"{name} is no list of transitions")
            for outcome in outcomes:
                probability, next_state, reward, terminated = _read(outcome, num_states, name)
                if probability > 0:
                    yield state, action, next_state, probability, reward, terminated


def _read(outcome: Any, num_states: int, name: str) -> tuple[float, int, float, bool]:
    with contextlib.suppress(*_NO_NUMBERS):
        probability, next_state, reward, terminated = outcome
        state, earned = int(next_state), float(reward)
        is_state = 0 <= state < num_states and state == next_state
        if 0 <= probability <= 1 and is_state and math.isfinite(earned):
            return float(probability), state, earned, bool(terminated)
    raise _UnsoundError(f"{name} holds {brief(outcome)}")


# What is raised by a value that is not a number, or not so many values.
_NO_NUMBERS = (TypeError, ValueError, OverflowError)
