import numpy as np
import pytest
from bound import (
    FORMULAS,
    TWO,
    begun,
    box,
    box_action,
    episode_generator,
    network,
    outputs_of,
)
from gymnasium.spaces import Box, Discrete

from gym_server.errors import GymServerError
from gym_server.policies.box import box_actions

NAMES = list(FORMULAS)


def observations(n, width, scale=3.0, dtype=np.float32):
    return np.random.default_rng(3).normal(scale=scale, size=(n, width)).astype(dtype)


@pytest.mark.parametrize("bias", [False, True])
@pytest.mark.parametrize("last", NAMES)
@pytest.mark.parametrize("hidden", NAMES)
def test_the_largest_output_is_the_action(hidden, last, bias):
    sizes, activation = [4, 3, 5], [hidden, last]
    weights = np.random.default_rng(1).normal(size=(2, 3 * (4 + bias) + 5 * (3 + bias)))
    acted = Discrete(5, start=2)
    policy = network(sizes, activation, box(4), acted, weights, bias)
    for candidate in range(2):
        actor = begun(policy, candidate)
        for observation in observations(200, 4):
            outputs = outputs_of(sizes, activation, weights[candidate], observation, bias)
            action = actor.act(observation)
            assert action == 2 + outputs.index(max(outputs))
            assert type(action) is np.int64


@pytest.mark.parametrize("name", NAMES)
def test_one_output_chooses_between_two_actions(name):
    weights = np.random.default_rng(1).normal(size=(1, 4))
    actor = begun(network([4, 1], [name], box(4), Discrete(2, start=3), weights))
    middle = 0.5 if name in ("logistic", "Gompertz") else 0
    chosen = set()
    for observation in observations(300, 4):
        (output,) = outputs_of([4, 1], [name], weights[0], observation)
        assert actor.act(observation) == 3 + (output > middle)
        chosen.add(output > middle)
    assert len(chosen) == 2


@pytest.mark.parametrize("name", NAMES)
def test_exactly_the_middle_is_the_first_action(name):
    actor = begun(network([1, 1], [name], box(1, np.inf), TWO, [[1.0]]))
    at_zero = actor.act(np.zeros(1, np.float32))
    assert at_zero == 0
    assert actor.act(np.array([5], np.float32)) == 1
    assert actor.act(np.array([-900], np.float32)) == 0


def test_an_output_that_rounds_to_the_middle_is_the_first_action():
    actor = begun(network([1, 1], ["logistic"], box(1, np.inf, np.float64), TWO, [[1.0]]))
    assert actor.act(np.array([1e-17])) == 0
    assert actor.act(np.array([1e-15])) == 1


@pytest.mark.parametrize("name", ["tanh", "logistic", "Gompertz"])
def test_of_saturated_outputs_the_first_is_taken(name):
    # Sums of 2000 and 1000: both outputs are exactly 1.
    weights = [[-1000.0, 1000.0, 2000.0]]
    actor = begun(network([1, 3], [name], box(1), Discrete(3), weights))
    assert actor.act(np.array([1], np.float32)) == 1
    # The same if the sums are far below 0.
    assert actor.act(np.array([-5], np.float32)) == 0


def test_a_network_of_zeros_takes_the_first_action():
    actor = begun(network([4, 3], ["identity"], box(4), Discrete(3), np.zeros((1, 12))))
    assert actor.act(observations(1, 4)[0]) == 0


@pytest.mark.parametrize("width", [1, 3, 8, 9, 12])
@pytest.mark.parametrize("last", NAMES)
def test_outputs_are_the_numbers_of_a_box(last, width):
    rng = np.random.default_rng(2)
    low = -rng.uniform(0.5, 2, width).astype(np.float32)
    high = rng.uniform(0.5, 2, width).astype(np.float32)
    sizes, activation = [3, 4, width], ["tanh", last]
    weights = rng.normal(size=(1, 12 + 4 * width))
    actor = begun(network(sizes, activation, box(3), Box(low, high), weights))
    for observation in observations(100, 3):
        outputs = outputs_of(sizes, activation, weights[0], observation)
        wanted = box_action(outputs, last, low.tolist(), high.tolist())
        action = actor.act(observation)
        assert (action.dtype, action.shape) == (np.float32, (width,))
        np.testing.assert_allclose(action, np.array(wanted, np.float32), rtol=2e-7, atol=1e-12)


@pytest.mark.parametrize("stretched_from", [None, "tanh", "logistic"])
def test_one_row_and_many_are_reckoned_alike(stretched_from):
    rng = np.random.default_rng(2)
    spaces = [
        Box(-2, 1, (8,), np.float32),
        Box(0, 255, (2, 4), np.uint8),
        Box(-(2**63), 2**63 - 1, (8,), np.int64),
    ]
    for space in spaces:
        outputs = np.empty(8)
        alone = box_actions(space, stretched_from, ())
        many = box_actions(space, stretched_from, (1,))
        for _ in range(500):
            outputs[:] = np.tanh(rng.normal(scale=5, size=8))
            if stretched_from is None:
                outputs *= rng.choice([1, 300, 1e30])
            one, other = alone(outputs), many(outputs[None])[0]
            assert one in space
            np.testing.assert_array_equal(one, other)
            assert (one.dtype, one.shape) == (other.dtype, other.shape)


def test_an_action_is_an_array_of_its_own():
    for width in (2, 20):
        actor = begun(network([1, width], ["identity"], box(1), box(width), np.ones((1, width))))
        first = actor.act(np.array([1], np.float32))
        actor.act(np.array([2], np.float32))
        assert (first == 1).all()


def test_an_observation_of_several_dimensions_is_taken_row_by_row():
    observed = Box(0, 255, (2, 3), np.uint8)
    for column in range(6):
        weights = np.zeros((1, 6))
        weights[0, column] = 1
        actor = begun(network([6, 1], ["identity"], observed, box(1, 1000), weights))
        observation = np.arange(6, dtype=np.uint8).reshape(2, 3)
        assert actor.act(observation) == [column]
        assert actor.act(np.asfortranarray(observation)) == [column]


@pytest.mark.parametrize("bias", [False, True])
def test_a_discrete_observation_selects_a_column(bias):
    observed, sizes, activation = Discrete(5, start=-1), [5, 3, 4], ["tanh", "logistic"]
    weights = np.random.default_rng(4).normal(size=(1, 3 * (5 + bias) + 4 * (3 + bias)))
    actor = begun(network(sizes, activation, observed, Discrete(4), weights, bias))
    for _ in range(2):
        for state in range(-1, 4):
            inputs = [float(state == other) for other in range(-1, 4)]
            outputs = outputs_of(sizes, activation, weights[0], inputs, bias)
            assert actor.act(np.int64(state)) == outputs.index(max(outputs))
    for wrong in (np.int64(4), -2, 0.5):
        with pytest.raises(GymServerError, match="not in its observation space") as refusal:
            actor.act(wrong)
        assert refusal.value.code == "environment_error"


def test_inputs_are_normalised():
    rng = np.random.default_rng(5)
    mean, scale, weights = rng.normal(size=4), rng.uniform(size=4), rng.normal(size=(1, 8))
    policy = network(
        [4, 2], ["identity"], box(4), box(2), weights, tensors={"mean": mean, "scale": scale}
    )
    actor = begun(policy)
    for observation in observations(50, 4):
        inputs = (observation.astype(float) - mean) * scale
        wanted = outputs_of([4, 2], ["identity"], weights[0], inputs)
        np.testing.assert_allclose(actor.act(observation), np.clip(wanted, -10, 10), rtol=1e-6)


def test_normalised_inputs_are_clipped():
    policy = network(
        *([3, 3], ["identity"], box(3, np.inf), box(3, np.inf), [np.eye(3).ravel()]),
        tensors={"mean": np.zeros(3), "scale": np.array([1e6, 1, 1e6])},
        clip_obs=2.5,
    )
    for actor in (
        begun(policy).act,
        lambda row: begun(policy, np.zeros(2, int)).act([row, row])[1],
    ):
        np.testing.assert_array_equal(actor(np.array([1.0, -2, -1])), [2.5, -2, -2.5])
        with pytest.raises(GymServerError, match="not a number"):
            actor(np.array([np.nan, 0, 0]))


def test_softmax_draws_by_the_outputs():
    policy = network(
        [1, 3], ["identity"], box(1), Discrete(3, start=1), [[0.0, 1.0, -1.0]], output="softmax"
    )
    actor = begun(policy, seed=8)
    drawn = [actor.act(np.array([1], np.float32)) for _ in range(3000)]
    p = np.exp([0, 1, -1]) / np.exp([0, 1, -1]).sum()
    u = episode_generator(8).random(3000)
    np.testing.assert_array_equal(drawn, 1 + (u[:, None] >= np.cumsum(p)[:2]).sum(axis=1))


def test_epsilon_greedy_explores_as_often_as_told():
    policy = network(
        [1, 3], ["identity"], box(1), Discrete(3), [[0.0, 1.0, 0.0]],
        output="epsilon-greedy", epsilon=0.3,
    )  # fmt: skip
    actor = begun(policy, seed=9)
    drawn = [actor.act(np.array([1], np.float32)) for _ in range(2000)]
    u = iter(episode_generator(9).random(4000).tolist())
    assert drawn == [int(next(u) * 3) if next(u) < 0.3 else 1 for _ in range(2000)]
    assert np.bincount(drawn, minlength=3).min() > 100


@pytest.mark.parametrize("width", [2, 12])
def test_gaussian_noise_is_added_to_the_outputs_and_cut_at_the_bounds_when_stepped(width):
    deviation = np.linspace(0, 2, width)
    policy = network(
        [1, width], ["tanh"], box(1), box(width, 1.5), np.full((1, width), 0.5),
        output="gaussian", tensors={"deviation": deviation},
    )  # fmt: skip
    actor = begun(policy, seed=4)
    noise = episode_generator(4).standard_normal((40, width))
    for row in noise:
        wanted = (np.tanh(0.5) + deviation * row).astype(np.float32)
        drawn = actor.act(np.ones(1, np.float32))
        np.testing.assert_allclose(drawn, wanted, rtol=1e-6)
        np.testing.assert_array_equal(actor.clip(drawn), np.clip(drawn, -1.5, 1.5))


def test_an_episode_is_drawn_from_its_seed_alone():
    policy = network([1, 3], ["identity"], box(1), Discrete(3), output="softmax")
    one = begun(policy, seed=1)
    observation = np.ones(1, np.float32)
    first = [one.act(observation) for _ in range(50)]
    one.begin(2)
    second = [one.act(observation) for _ in range(7)]
    one.begin(1)
    assert [one.act(observation) for _ in range(50)] == first
    other = begun(policy, seed=2)
    assert [other.act(observation) for _ in range(7)] == second


@pytest.mark.filterwarnings("ignore:(overflow|invalid):RuntimeWarning")
def test_outputs_that_are_not_numbers_are_refused():
    huge = [[1e308, 1e308, -1e308, -1e308] * 2]
    inputs = np.array([10, 10], np.float32)
    for acted, fields in (
        (Discrete(2), {}), (Discrete(2), {"output": "softmax"}), (box(2), {}),
    ):  # fmt: skip
        policy = network([2, 2, 2], ["identity"] * 2, box(2), acted, huge, **fields)
        with pytest.raises(GymServerError, match="not a number") as refusal:
            begun(policy).act(inputs)
        assert refusal.value.code == "invalid_policy"
