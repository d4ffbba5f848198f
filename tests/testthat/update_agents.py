"""Updates of ARS and of CEM in NumPy, written from the papers, for the tests of the agents.

Reads JSON from the given file, and prints the weights and other results after each update.
"""

import json
import sys

import numpy as np


def running_moments(seen):
    every = np.concatenate(seen)
    return len(every), every.mean(axis=0), every.std(axis=0, ddof=1)


def ars(case):
    weights = np.array(case["start"], dtype=float)
    seen, after = [], []
    used = case["top"] if case["version"].endswith("-t") else case["directions"]
    for update in case["updates"]:
        directions = np.array(update["directions"])
        along, against = np.array(update["along"]), np.array(update["against"])
        steps_along = np.array(update["steps_along"])
        steps_against = np.array(update["steps_against"])
        along = along - case["shift"] * steps_along
        against = against - case["shift"] * steps_against
        chosen = sorted(range(len(along)), key=lambda k: (-max(along[k], against[k]), k))[:used]
        deviation = np.concatenate([along[chosen], against[chosen]]).std()
        if deviation > 0:
            total = np.zeros_like(weights)
            for k in chosen:
                total += (along[k] - against[k]) * directions[k]
            weights = weights + case["step_size"] / (used * deviation) * total
        seen.append(np.array(update["observations"]))
        one = {"weights": weights.tolist()}
        if case["version"].startswith("V2"):
            count, mean, deviation = running_moments(seen)
            observation = np.array(case["observation"])
            with np.errstate(divide="ignore"):
                shown = np.where(deviation < 1e-7, 0, (observation - mean) / deviation)
            one |= {"count": count, "mean": mean.tolist(), "shown": shown.tolist()}
        else:
            one["shown"] = case["observation"]
        after.append(one)
    return after


def cem(case):
    after = []
    for number, update in enumerate(case["updates"], start=1):
        weights, returns = np.array(update["weights"]), np.array(update["returns"])
        elite = weights[np.argsort(-returns, kind="stable")[: case["elite"]]]
        left = max(0.0, 1 - number / case["extra_iterations"])
        deviation = elite.std(axis=0)
        drawn_with = np.sqrt(elite.var(axis=0) + case["extra_noise"] ** 2 * left)
        after.append(
            {
                "weights": elite.mean(axis=0).tolist(),
                "deviation": deviation.tolist(),
                "drawn_with": drawn_with.tolist(),
            }
        )
    return after


with open(sys.argv[1]) as file:
    cases = json.load(file)
print(json.dumps([{"ars": ars, "cem": cem}[case["agent"]](case) for case in cases]))
