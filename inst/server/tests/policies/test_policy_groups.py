"""Groups in lockstep: a row's actions must not depend on the other rows."""

import numpy as np
import pytest
from bound import begun, box, count_weights, network, outputs_of, table
from gymnasium.spaces import Box, Discrete
from gymnasium.vector.utils import batch_space

from gym_server.policies import read_policy

ROWS = 64
FEW, MANY = [4, 3, 2], [4, 30, 30, 3]


def started(policy, candidates, seed=3):
    group = policy.actor(np.asarray(candidates))
    group.begin(seed)
    return group


def observations(n, width=4):
    return np.random.default_rng(1).normal(size=(n, ROWS, width)).astype(np.float32)


def policy_of(sizes, acted, bias=True, observed=None, **fields):
    layers = len(sizes) - 1
    activation = ["tanh"] * (layers - 1) + ["identity"]
    return network(
        sizes, activation, observed or box(sizes[0]), acted, bias=bias, candidates=5, **fields
    )


KINDS = {
    "few weights": policy_of(FEW, Discrete(2)),
    "many weights": policy_of(MANY, Discrete(3, start=1)),
    "softmax": policy_of(FEW, Discrete(2), output="softmax"),
    "many, epsilon": policy_of(MANY, Discrete(3), output="epsilon-greedy", epsilon=0.4),
    "box": policy_of(MANY, box(3, 0.5)),
    "gaussian": policy_of(
        FEW, box(2), output="gaussian", tensors={"deviation": np.full((5, 2), 0.5)}
    ),
    "list": read_policy(
        {
            "kind": "list",
            "policies": [
                {"kind": "network", "sizes": [4, 3], "activation": ["identity"], **fields}
                for fields in (
                    {}, {"output": "softmax"}, {"output": "epsilon-greedy", "epsilon": 0.3}
                )
            ]
            + [{"kind": "random"}] * 2,
        },
        {f"{i}/weights": np.random.default_rng(i).normal(size=(1, 12)) for i in range(3)},
        box(4),
        Discrete(3),
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_a_row_does_not_depend_on_the_others(kind):
    policy = KINDS[kind]
    mixed = np.random.default_rng(2).integers(5, size=ROWS)
    together = started(policy, mixed)
    alone = [started(policy, np.full(ROWS, candidate)) for candidate in range(5)]
    for batch in observations(20):
        actions = together.act(batch)
        for candidate, group in enumerate(alone):
            rows = mixed == candidate
            others = np.where(rows[:, None], batch, -batch)
            np.testing.assert_array_equal(group.act(others)[rows], actions[rows])


@pytest.mark.parametrize("kind", KINDS)
def test_a_row_does_not_depend_on_which_others_are_played(kind):
    policy = KINDS[kind]
    candidates = np.random.default_rng(2).integers(5, size=ROWS)
    some = np.where(np.isin(np.arange(ROWS), [3, 4, 20]), candidates, -1)
    together, few = started(policy, candidates), started(policy, some)
    for batch in observations(20):
        np.testing.assert_array_equal(few.act(batch)[some >= 0], together.act(batch)[some >= 0])


def test_rows_that_nobody_plays_are_not_computed():
    group = started(KINDS["many weights"], np.where(np.arange(ROWS) < 40, 0, -1))
    batch = observations(1)[0]
    batch[40:] = np.nan
    assert (group.act(batch)[40:] == 1).all()


@pytest.mark.parametrize("kind", KINDS)
def test_a_group_is_drawn_from_its_seed_alone(kind):
    policy, batches = KINDS[kind], observations(10)
    group = started(policy, np.arange(ROWS) % 5)
    first = [group.act(batch) for batch in batches]
    group.begin(4)
    group.act(batches[0])
    group.begin(3)
    for batch, actions in zip(batches, first, strict=True):
        np.testing.assert_array_equal(group.act(batch), actions)


@pytest.mark.parametrize("bias", [False, True])
@pytest.mark.parametrize("sizes", [FEW, MANY])
@pytest.mark.parametrize("acted", [Discrete, Box])
@pytest.mark.parametrize("is_counted", [False, True])
def test_a_group_acts_as_single_episodes_do(sizes, acted, bias, is_counted):
    space = Discrete(sizes[-1], start=2) if acted is Discrete else box(sizes[-1], 0.7)
    observed = Discrete(4, start=3) if is_counted else None
    policy = policy_of(sizes, space, bias, observed)
    candidates = np.arange(ROWS) % 5
    group = started(policy, candidates)
    actors = [begun(policy, candidate) for candidate in range(5)]
    batches = (
        np.random.default_rng(1).integers(3, 7, size=(5, ROWS)) if is_counted else observations(5)
    )
    for batch in batches:
        actions = group.act(batch)
        assert actions in batch_space(space, ROWS)
        singly = [actors[c].act(o) for c, o in zip(candidates, batch, strict=True)]
        np.testing.assert_allclose(actions, np.array(singly), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("sizes", [[4, 1], [4, 2, 1]])
def test_one_output_chooses_between_two_actions(sizes):
    activation = ["tanh", "logistic"][-(len(sizes) - 1) :]
    weights = np.random.default_rng(6).normal(size=(2, count_weights(sizes)))
    policy = network(sizes, activation, box(4), Discrete(2), weights)
    candidates = np.arange(ROWS) % 2
    (batch,) = observations(1)
    outputs = [
        outputs_of(sizes, activation, weights[c], o)[0] > 0.5
        for c, o in zip(candidates, batch, strict=True)
    ]
    np.testing.assert_array_equal(started(policy, candidates).act(batch), outputs)


def test_inputs_are_normalised():
    moments = {"mean": np.array([5.0, 0, 0, 0]), "scale": np.array([1.0, 0, 0, 0])}
    policy = network([4, 1], ["identity"], box(4), Discrete(2), [[1.0] * 4], tensors=moments)
    batch = np.zeros((ROWS, 4), np.float32)
    batch[::2, 0] = 6
    actions = started(policy, np.zeros(ROWS, int)).act(batch)
    np.testing.assert_array_equal(actions, np.arange(ROWS) % 2 == 0)


def test_tables_act_for_all_rows():
    q = np.random.default_rng(1).normal(size=(2, 5, 3))
    candidates = np.arange(ROWS) % 2
    states = np.random.default_rng(2).integers(5, size=ROWS)
    greedy = started(table(q, Discrete(5, start=1), Discrete(3)), candidates)
    best = q[candidates, states].argmax(axis=1)
    np.testing.assert_array_equal(greedy.act(states + 1), best)
    for fields in ({"epsilon": 0.5}, {"temperature": 1}):
        group = started(table(q, Discrete(5, start=1), Discrete(3), **fields), candidates)
        drawn = [group.act(states + 1) for _ in range(30)]
        assert 0.05 < np.mean(np.array(drawn) != best) < 0.8
