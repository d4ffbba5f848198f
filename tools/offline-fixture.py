"""Make tests/testthat/offline.json: what obp and NumPy say of a policy's value, on their data."""

# Python 3.9 or older, as obp asks for:
# python -m venv scratch && scratch/bin/pip install obp==0.5.5
# scratch/bin/python tools/offline-fixture.py > tests/testthat/offline.json

import json
from importlib.metadata import version

import numpy as np
from obp.dataset import OpenBanditDataset
from obp.ope import (
    DirectMethod,
    DoublyRobust,
    InverseProbabilityWeighting,
    RegressionModel,
    SelfNormalizedInverseProbabilityWeighting,
)
from sklearn.linear_model import LogisticRegression

ROWS = 2000


def open_bandit():
    """Evaluate a policy by clicks of the small Open Bandit data that obp has with it."""
    feedback = OpenBanditDataset(
        behavior_policy="bts", campaign="men"
    ).obtain_batch_bandit_feedback()
    logged = {name: feedback[name][:ROWS] for name in ("position", "action", "reward", "pscore")}
    actions = feedback["n_actions"]
    # The estimate depends on the place and the item alone, so that predictions fit in a small
    # table.
    model = RegressionModel(
        n_actions=actions,
        len_list=3,
        action_context=feedback["action_context"],
        base_model=LogisticRegression(C=10),
    )
    model.fit(
        np.ones((ROWS, 1)), logged["action"], logged["reward"], logged["pscore"], logged["position"]
    )
    reward = np.round(model.predict(np.ones((1, 1))), 6)
    chosen = np.exp(50 * reward)
    chosen = np.round(chosen / chosen.sum(axis=1, keepdims=True), 6)
    chosen[:, 0, :] += 1 - chosen.sum(axis=1)
    given = {
        **logged,
        "action_dist": np.repeat(chosen, ROWS, axis=0),
        "estimated_rewards_by_reg_model": np.repeat(reward, ROWS, axis=0),
    }
    estimators = {
        "is": InverseProbabilityWeighting(),
        "wis": SelfNormalizedInverseProbabilityWeighting(),
        "fqe": DirectMethod(),
        "dr": DoublyRobust(),
    }
    return {
        **{name: values.tolist() for name, values in logged.items()},
        "predicted": reward[0].tolist(),
        "policy": chosen[0].tolist(),
        "estimates": {
            name: estimator.estimate_policy_value(**given) for name, estimator in estimators.items()
        },
    }


def fitted_q(horizon=None, discount=0.9, episodes=60, length=5):
    """Evaluate a policy by least squares on 1, x, x^2 for each of two actions."""
    rng = np.random.default_rng(1)
    x = np.round(rng.uniform(-1, 1, (episodes, length + 1)), 3)
    action = rng.integers(0, 2, (episodes, length))
    reward = np.round(x[:, :-1] * (2 * action - 1) + rng.normal(0, 0.1, action.shape), 3)
    ends = np.zeros(action.shape, bool)
    ends[:, -1] = True

    def features(state, taken):
        basis = np.stack([np.ones_like(state), state, state**2], axis=-1)
        return np.concatenate(
            [basis * (taken == 0)[..., None], basis * (taken == 1)[..., None]], -1
        )

    def value(state):
        up = np.clip(0.5 + 0.4 * state, 0, 1)[..., None]
        none = np.zeros_like(state)
        mean = (1 - up) * features(state, none) + up * features(state, none + 1)
        return mean @ weights

    here = features(x[:, :-1], action).reshape(-1, 6)
    weights = np.zeros(6)
    for _ in range(horizon or 1000):
        target = reward + discount * np.where(ends, 0, value(x[:, 1:]))
        weights = np.linalg.lstsq(here, target.ravel(), rcond=None)[0]
    return {
        "x": x[:, :-1].ravel().tolist(),
        "action": action.ravel().tolist(),
        "reward": reward.ravel().tolist(),
        "length": length,
        "value": value(x[:, 0]).mean(),
    }


print(
    json.dumps(
        {
            "made_by": f"obp {version('obp')}, NumPy {version('numpy')}",
            "open_bandit": open_bandit(),
            "fitted_q": {**fitted_q(), "value_in_3_steps": fitted_q(3)["value"]},
        }
    )
)
