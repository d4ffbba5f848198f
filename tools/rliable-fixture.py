"""Make tests/testthat/rliable.json: simulated scores, and what rliable says of them."""

# python -m venv scratch && scratch/bin/pip install rliable "pandas<3"
# scratch/bin/python tools/rliable-fixture.py > tests/testthat/rliable.json

import json
from importlib.metadata import version

import numpy as np
from rliable import library, metrics

rng = np.random.default_rng(1)
# A matrix of runs by environments. It is rounded, so that some scores are equal.
scores = {
    "x": np.round(rng.normal(0.6, 0.3, (10, 3)), 2),
    "y": np.round(rng.normal(0.5, 0.4, (8, 3)), 2),
}
taus = np.array([0.0, 0.25, 0.5, 0.75, 1.0])


def aggregates(runs):
    """Return mean, median and interquartile mean."""
    return np.array(
        [
            metrics.aggregate_mean(runs),
            metrics.aggregate_median(runs),
            metrics.aggregate_iqm(runs),
        ]
    )


def improvement(pair_x, pair_y):
    """Return the probability that x scores higher."""
    return np.array([metrics.probability_of_improvement(pair_x, pair_y)])


reps = 50000
points, intervals = library.get_interval_estimates(
    scores, aggregates, reps=reps, random_state=np.random.RandomState(1)
)
pair, pair_interval = library.get_interval_estimates(
    {"x,y": (scores["x"], scores["y"])},
    improvement,
    reps=2000,
    random_state=np.random.RandomState(1),
)
profiles, profile_intervals = library.create_performance_profile(scores, taus, reps=2000)
print(
    json.dumps(
        {
            "rliable": version("rliable"),
            "scores": {name: runs.tolist() for name, runs in scores.items()},
            "points": {name: value.tolist() for name, value in points.items()},
            "intervals": {name: value.tolist() for name, value in intervals.items()},
            "improvement": pair["x,y"].tolist(),
            "improvement_interval": pair_interval["x,y"].ravel().tolist(),
            "taus": taus.tolist(),
            "profiles": {name: value.tolist() for name, value in profiles.items()},
            "profile_intervals": {
                name: value.tolist() for name, value in profile_intervals.items()
            },
        },
        indent=1,
    )
)
