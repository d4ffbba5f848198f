"""Solve Gymnasium's own tables with plain loops, to compare with solve_mdp().

The arguments are an id, the environment's arguments as JSON, and a horizon, 0 for none. Prints the
values of all states, and their mean over the start distribution, as JSON.
"""

import json
import sys

import gymnasium

name, kwargs, horizon = sys.argv[1], json.loads(sys.argv[2]), int(sys.argv[3])
env = gymnasium.make(name, **kwargs).unwrapped
table = env.P


def backup(values):
    """Apply Bellman's equation to every state."""
    new = []
    for state in range(len(values)):
        returns = []
        for transitions in table[state].values():
            returns.append(
                sum(p * (r + (0 if end else values[to])) for p, to, r, end in transitions)
            )
        new.append(max(returns))
    return new


values = [0.0] * len(table)
for _ in range(horizon or 20_000):
    before, values = values, backup(values)
    if not horizon and max(abs(a - b) for a, b in zip(before, values, strict=True)) < 1e-14:
        break
start = sum(p * v for p, v in zip(env.initial_state_distrib, values, strict=True))
print(json.dumps({"values": values, "start": start}))
