from collections import OrderedDict

import numpy as np
import pytest
from bound import TWO, begun, episode_generator, table
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, MultiDiscrete, Tuple

from gym_server.errors import GymServerError
from gym_server.policies.discrete import draw_index
from gym_server.policies.states import states_of

MINUS = -np.inf


def test_the_first_of_the_largest_values_is_taken():
    q = [[0, 1, 1], [2, 2, 2], [MINUS, MINUS, -5], [np.inf, 0, np.inf]]
    actor = begun(table(q, Discrete(4, start=1), Discrete(3, start=10)))
    for _ in range(2):
        actions = [actor.act(np.int64(state)) for state in (1, 2, 3, 4)]
        assert actions == [11, 10, 12, 10]
        assert all(type(action) is np.int64 for action in actions)


def test_each_candidate_has_its_table():
    policy = table([[[0, 1]], [[1, 0]]], Discrete(1), TWO)
    assert policy.candidates == 2
    assert [begun(policy, candidate).act(0) for candidate in (0, 1)] == [1, 0]


@pytest.mark.parametrize(
    "space",
    [
        Discrete(3, start=-1),
        MultiDiscrete([2, 3, 2], start=[0, 5, -1]),
        MultiDiscrete([[2, 3], [1, 2]]),
        MultiBinary(3),
        MultiBinary((2, 2)),
        Tuple((Discrete(3), MultiBinary(2), Discrete(2, start=4))),
        Dict(OrderedDict(b=Discrete(2), a=Tuple((Discrete(3), Discrete(2))))),
    ],
)
def test_states_are_counted_with_the_last_number_changing_first(space):
    states = states_of(space)
    flat = {}
    for _ in range(300):
        value = space.sample()
        flat[tuple(numbers_of(space, value))] = states.index(value)
    assert [flat[key] for key in sorted(flat)] == list(range(states.count))


def numbers_of(space, value):
    match space:
        case Tuple():
            return [n for s, v in zip(space, value, strict=True) for n in numbers_of(s, v)]
        case Dict():
            return [n for key in space.spaces for n in numbers_of(space[key], value[key])]
        case _:
            return np.ravel(value).tolist()


def test_an_observation_outside_of_the_space_has_no_row():
    blackjack = Tuple((Discrete(2), Discrete(2)))
    for space, wrong in (
        (Discrete(4), 4), (Discrete(4), -1), (Discrete(4), 0.5), (Discrete(4), None),
        (blackjack, (0, 2)), (blackjack, (0,)), (MultiDiscrete([2, 2]), np.array([0, 1, 0])),
        (MultiDiscrete([2, 2]), np.array([0, -1])),
    ):  # fmt: skip
        actor = begun(table(np.zeros((4, 2)), space, TWO))
        with pytest.raises(GymServerError, match="has no row for the observation") as refusal:
            actor.act(wrong)
        assert refusal.value.code == "invalid_policy"


def test_a_row_that_leaves_no_action_is_an_error_when_it_is_met():
    for fields in ({}, {"epsilon": 0.5}, {"temperature": 1}):
        policy = table([[0, 1], [MINUS, MINUS]], Discrete(2), TWO, **fields)
        actor = begun(policy)
        actor.act(0)
        with pytest.raises(GymServerError, match="Row 2 of the policy's table leaves no action"):
            actor.act(1)
        group = policy.actor(np.zeros(2, int))
        group.begin(1)
        with pytest.raises(GymServerError, match="Row 2"):
            group.act(np.array([0, 1]))


def test_epsilon_explores_among_the_actions_that_can_be_taken():
    actor = begun(table([[3, MINUS, 1, 2]], Discrete(1), Discrete(4), epsilon=0.5), seed=6)
    drawn = [actor.act(0) for _ in range(1000)]
    u = iter(episode_generator(6).random(2000).tolist())
    wanted = []
    for _ in range(1000):
        explores = next(u) < 0.5
        wanted.append([0, 2, 3][int(next(u) * 3)] if explores else 0)
    assert drawn == wanted


def test_the_temperature_draws_by_a_softmax():
    actor = begun(
        table([[0, MINUS, 1]], Discrete(1), Discrete(3), temperature=0.5, epsilon=1), seed=6
    )
    p = np.exp([0, 2]) / np.exp([0, 2]).sum()
    u = episode_generator(6).random(500)
    assert [actor.act(0) for _ in range(500)] == np.where(u >= p[0], 2, 0).tolist()


def test_one_row_and_many_are_drawn_alike():
    rng = np.random.default_rng(1)
    for _ in range(300):
        weights = rng.uniform(size=5) * rng.integers(2, size=5)
        weights[rng.integers(5)] = 1
        sums = np.cumsum(weights)
        for u in [*rng.random(10).tolist(), 0.0, 1 - 2**-53]:
            chosen = draw_index(sums, u)
            assert chosen == draw_index(sums[:, None], np.array([u]))[0]
            assert weights[chosen] > 0


def test_a_table_needs_states_that_can_be_counted():
    for observed, acted in (
        (Box(0, 1, (2,)), TWO), (Tuple((Discrete(2), Box(0, 1, (1,)))), TWO),
        (Discrete(2), Box(0, 1, (1,))), (Discrete(2), Tuple((TWO, TWO))),
    ):  # fmt: skip
        with pytest.raises(GymServerError) as refusal:
            table(np.zeros((2, 2)), observed, acted)
        assert refusal.value.code == "not_supported"
