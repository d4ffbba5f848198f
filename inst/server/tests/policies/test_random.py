import copy

import numpy as np
import pytest
from bound import begun, episode_generator
from gymnasium.spaces import (
    Box,
    Dict,
    Discrete,
    Graph,
    MultiBinary,
    MultiDiscrete,
    OneOf,
    Sequence,
    Text,
    Tuple,
)
from gymnasium.vector.utils import batch_space
from random_spaces import same

from gym_server.policies import read_policy
from gym_server.policies.random import _with_parts

pytestmark = pytest.mark.slow

RANDOM = {"kind": "random"}
OBSERVED = Box(-1, 1, (2,))

SPACES = [
    Discrete(1),
    Discrete(2),
    Discrete(7, start=-3),
    Discrete(2**40),
    Box(-1, 1, (3,), np.float32),
    Box(-2, 5, (2, 2), np.float64),
    Box(np.array([-1, 0.5], "f2"), np.array([1, 7], "f2"), dtype=np.float16),
    Box(-1.0, 1.0, (), np.float32),
    Box(-3e38, 3e38, (1,), np.float32),
    Box(-np.inf, np.inf, (2,), np.float32),
    Box(np.array([-np.inf, 0, 0]), np.array([1.0, np.inf, 1]), dtype=np.float64),
    Box(0, 255, (2,), np.uint8),
    Box(-5, 5, (2,), np.int64),
    MultiDiscrete([3, 4], start=[1, 0]),
    MultiBinary(5),
    Text(4),
    Tuple((Discrete(3), Box(-1, 1, (2,)), Dict(a=Discrete(2), b=MultiBinary(2)))),
    Sequence(Discrete(4)),
    OneOf((Discrete(3), Box(0, 1, (1,)))),
    Graph(Box(0, 1, (2,)), Discrete(3)),
]


def sampler(space, seed):
    own, generator = copy.deepcopy(space), episode_generator(seed)
    for node in _with_parts(own):
        node._np_random = generator
    return own.sample


@pytest.mark.parametrize("space", SPACES, ids=str)
def test_it_draws_as_sample_does(space):
    actor = read_policy(RANDOM, {}, OBSERVED, space).actor(0)
    # A second episode, and one that ends early, start anew.
    for seed, steps in ((3, 700), (4, 5), (2**40, 60), (3, 40)):
        actor.begin(seed)
        sample = sampler(space, seed)
        for _ in range(steps):
            action, wanted = actor.act(None), sample()
            assert same(action, wanted)
            assert type(action) is type(wanted)
            assert getattr(action, "dtype", None) == getattr(wanted, "dtype", None)


def test_the_draws_of_the_environments_space_are_left_alone():
    space = Tuple((Discrete(5), Box(0, 1, (1,))))
    space.seed(1)
    other = copy.deepcopy(space)
    begun(read_policy(RANDOM, {}, OBSERVED, space)).act(None)
    assert same([space.sample() for _ in range(5)], [other.sample() for _ in range(5)])


def test_any_candidate_is_the_same():
    policy = read_policy(RANDOM, {}, OBSERVED, Discrete(9))
    assert policy.candidates is None
    one, other = begun(policy, 0), begun(policy, 17)
    assert [one.act(None) for _ in range(20)] == [other.act(None) for _ in range(20)]


def test_it_may_have_fewer_actions():
    fewer = {**RANDOM, "action_space": {"n": 2, "start": 3}}
    actor = begun(read_policy(fewer, {}, OBSERVED, Discrete(6)), seed=1)
    sample = sampler(Discrete(2, start=3), 1)
    assert [actor.act(None) for _ in range(50)] == [sample() for _ in range(50)]


def test_a_group_draws_all_rows_at_once():
    for space in (Discrete(3, start=2), Box(-1, 1, (2,))):
        group = read_policy(RANDOM, {}, OBSERVED, space).actor(np.zeros(8, int))
        group.begin(5)
        sample = sampler(batch_space(space, 8), 5)
        for _ in range(10):
            np.testing.assert_array_equal(group.act(None), sample())
