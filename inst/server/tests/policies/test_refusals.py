"""The error for an invalid policy names the problem in a sentence."""

import numpy as np
import pytest
from bound import TWO, box
from gymnasium.spaces import Box, Discrete, MultiDiscrete, Tuple

from gym_server.errors import GymServerError
from gym_server.policies import read_policy

NETWORK = {"kind": "network", "sizes": [4, 2, 1], "activation": ["tanh", "logistic"]}
LINEAR = {"kind": "network", "sizes": [4, 2], "activation": ["identity"]}
TABLE = {"kind": "table"}
WEIGHTS = {"weights": np.zeros((3, 10))}
EIGHT = {"weights": np.zeros((1, 8))}
Q = {"q": np.zeros((4, 2))}
FIELD = Discrete(4)


def refused(document, tensors, observed=None, acted=TWO):
    with pytest.raises(GymServerError) as refusal:
        read_policy(document, tensors, box(4) if observed is None else observed, acted)
    return refusal.value


def with_value(shape, value):
    tensor = np.zeros(shape)
    tensor.flat[-1] = value
    return tensor


CASES = [
    ({}, {}, "kind is one of random, network, table or list"),
    ([], {}, "must be an object"),
    ({"kind": "memory"}, {}, '"memory"'),
    ({"kind": ["network"]}, {}, "kind is one of"),
    ({"kind": "random", "epsilon": 1}, {}, 'A random policy has no field "epsilon"'),
    ({"kind": "random"}, WEIGHTS, 'A random policy has no tensor "weights"'),
    ({"kind": "random", "action_space": {"n": 3}}, {}, "within the environment's Discrete(2)"),
    ({"kind": "random", "action_space": {"n": 1, "start": -1}}, {}, '"start": -1'),
    ({"kind": "random", "action_space": {"n": 0}}, {}, '{"n": 0}'),
    ({"kind": "random", "action_space": {"n": True}}, {}, '{"n": true}'),
    ({"kind": "random", "action_space": {"low": 0}}, {}, '{"low": 0}'),
    ({**NETWORK, "sizes": [4, 3, 1]}, WEIGHTS, "a row of 15 numbers for each candidate"),
    ({**NETWORK, "bias": True}, WEIGHTS, "4-2-1 with a bias needs, not 3 x 10"),
    ({**NETWORK, "bias": 1}, WEIGHTS, "bias must be true or false, not 1"),
    ({**NETWORK, "sizes": [3, 2, 1]}, WEIGHTS, "takes 3 inputs and gives 1 output, but an"),
    ({**NETWORK, "sizes": [4, 2, 3]}, WEIGHTS, "gives 3 outputs, but an observation of"),
    ({**NETWORK, "sizes": [4]}, WEIGHTS, "two or more whole numbers from 1, not [4]"),
    ({**NETWORK, "sizes": [4, 0, 1]}, WEIGHTS, "not [4, 0, 1]"),
    ({**NETWORK, "sizes": [4, 2.0, 1]}, WEIGHTS, "not [4, 2.0, 1]"),
    ({**NETWORK, "sizes": "4-2-1"}, WEIGHTS, '"4-2-1"'),
    ({**NETWORK, "sizes": [4, 10**15, 1]}, WEIGHTS, "for each candidate"),
    ({**NETWORK, "activation": ["tanh"]}, WEIGHTS, "must be 2 names"),
    ({**NETWORK, "activation": ["tanh", "elu"]}, WEIGHTS, 'not ["tanh", "elu"]'),
    ({**NETWORK, "activation": ["tanh", ["elu"]]}, WEIGHTS, "must be 2 names"),
    (NETWORK, {}, "no tensor weights"),
    (NETWORK, {"weights": np.zeros((0, 10))}, "not 0 x 10"),
    (NETWORK, {"weights": np.zeros(10)}, "a row of 10 numbers"),
    (NETWORK, {"weights": with_value((2, 10), np.nan)}, 'finite numbers, not "NaN"'),
    (NETWORK, {"weights": with_value((2, 10), -np.inf)}, 'finite numbers, not "-Infinity"'),
    (NETWORK, {"weights": np.zeros((3, 10), bool)}, "must be numbers, not bool"),
    (NETWORK, {"weights": np.zeros((100_001, 10))}, "1,000,010 numbers"),
    (NETWORK, {**WEIGHTS, "q": np.zeros(1)}, 'no tensor "q"'),
    (NETWORK, {**WEIGHTS, "mean": np.zeros(4)}, "no tensor scale"),
    (NETWORK, {**WEIGHTS, "mean": np.zeros(3), "scale": np.ones(4)}, "mean must be a number for"),
    (NETWORK, {**WEIGHTS, "mean": np.zeros(4), "scale": with_value(4, np.inf)}, "scale must be"),
    ({**NETWORK, "clip_obs": 0}, WEIGHTS, "clip_obs must be a number above 0, not 0"),
    ({**NETWORK, "output": "best"}, WEIGHTS, 'not "best"'),
    ({**NETWORK, "output": "softmax"}, WEIGHTS, 'not "softmax"'),
    ({**NETWORK, "output": "gaussian"}, WEIGHTS, "epsilon-greedy with 1 output for Discrete(2)"),
    ({**LINEAR, "output": "epsilon-greedy"}, EIGHT, "needs an epsilon"),
    ({**LINEAR, "output": "epsilon-greedy", "epsilon": 1.5}, EIGHT, "from 0 to 1, not 1.5"),
    ({**LINEAR, "epsilon": float("nan")}, EIGHT, "epsilon must be a number from 0 to 1"),
    (LINEAR, {**EIGHT, "deviation": np.ones(2)}, 'no tensor "deviation"'),
    ({"kind": "list", "policies": []}, {}, "from 1 to 10,000"),
    ({"kind": "list", "policies": {"kind": "random"}}, {}, "from 1 to 10,000"),
    ({"kind": "list", "policies": [{"kind": "list"}]}, {}, "Policy 1 of the list"),
    ({"kind": "list", "policies": [{"kind": "random"}, NETWORK]}, {}, "Policy 2 of the list: The"),
    ({"kind": "list", "policies": [{"kind": "random"}]}, {"1/q": np.zeros(1)}, '"1/q" belongs to'),
    ({"kind": "list", "policies": [NETWORK]}, {"0/weights": np.zeros((2, 10))}, "has 2 candidates"),
    ({"kind": "list", "policies": [{"kind": "random"}], "n": 1}, {}, 'no field "n"'),
]  # fmt: skip


@pytest.mark.parametrize(("document", "tensors", "words"), CASES, ids=[c[2] for c in CASES])
def test_a_policy_that_is_malformed_or_does_not_fit_is_refused(document, tensors, words):
    error = refused(document, tensors)
    assert (error.code, error.status) == ("invalid_policy", 400)
    assert words in error.message
    assert error.message[0].isupper() and not error.message.endswith(".")


@pytest.mark.parametrize(
    ("fields", "q", "words"),
    [
        (
            {},
            np.zeros((5, 2)),
            "a table of 4 states and 2 actions, or one for each candidate, not 5 x 2",
        ),
        ({}, np.zeros((4, 3)), "not 4 x 3"),
        ({}, np.zeros(8), "or one for each candidate, not 8"),
        ({}, np.zeros((0, 4, 2)), "not 0 x 4 x 2"),
        ({}, with_value((4, 2), np.nan), "not NaN"),
        ({"epsilon": -0.1}, np.zeros((4, 2)), "not -0.1"),
        ({"epsilon": "0.1"}, np.zeros((4, 2)), 'not "0.1"'),
        ({"temperature": 0}, np.zeros((4, 2)), "temperature must be a number above 0, not 0"),
        ({"temperature": float("inf")}, np.zeros((4, 2)), "temperature must be a number above 0"),
        ({"temperature": True}, np.zeros((4, 2)), "not true"),
        ({"temperature": 1}, with_value((4, 2), np.inf), "must not be Inf"),
    ],
)
def test_a_table_that_does_not_fit_is_refused(fields, q, words):
    error = refused({**TABLE, **fields}, {"q": q}, FIELD)
    assert (error.code, words in error.message) == ("invalid_policy", True), error.message


def test_a_box_without_bounds_has_no_scale():
    document = {"kind": "network", "sizes": [4, 2], "activation": ["tanh"]}
    unbounded = Box(-np.inf, np.inf, (2,))
    error = refused(document, EIGHT, acted=unbounded)
    assert (error.code, "side without a bound" in error.message) == ("invalid_policy", True)
    noisy = {**document, "output": "gaussian"}
    for deviation, words in ((np.ones(3), "not 3"), (np.array([1, -1.0]), "from 0, not -1.0")):
        error = refused(noisy, {**EIGHT, "deviation": deviation}, acted=unbounded)
        assert words in error.message
    read_policy(noisy, {**EIGHT, "deviation": np.ones(2)}, box(4), unbounded)


def test_a_discrete_observation_is_not_normalised():
    moments = {"mean": np.zeros(4), "scale": np.ones(4)}
    assert 'no tensor "mean"' in refused(LINEAR, {**EIGHT, **moments}, FIELD).message


def test_fewer_random_actions_are_discrete():
    document = {"kind": "random", "action_space": {"n": 1}}
    assert "omit its action_space" in refused(document, {}, acted=box(1)).hint


def test_composite_actions_are_only_for_random_policies():
    for acted in (Tuple((TWO, TWO)), MultiDiscrete([2, 2])):
        for document, tensors, observed in ((LINEAR, EIGHT, box(4)), (TABLE, Q, FIELD)):
            assert refused(document, tensors, observed, acted).code == "not_supported"
        read_policy({"kind": "random"}, {}, FIELD, acted)
    assert refused(LINEAR, EIGHT, Tuple((TWO, TWO))).code == "not_supported"
