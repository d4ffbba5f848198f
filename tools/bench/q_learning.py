"""Q-learning as a plain loop with a NumPy table, over Gymnasium's own environment.

Reads lines with a JSON object (env_id, steps, seed) and answers each with the processor's seconds.
"""

import json
import sys
import time

import gymnasium
import numpy as np


def learn(env_id: str, steps: int, seed: int) -> float:
    """Learn from so many steps, and return the CPU seconds."""
    env = gymnasium.make(env_id)
    rng = np.random.default_rng(seed)
    q = np.zeros((env.observation_space.n, env.action_space.n))
    actions = q.shape[1]
    began = time.process_time()
    state, _ = env.reset(seed=seed)
    for _ in range(steps):
        if rng.random() < 0.1:
            action = int(rng.integers(actions))
        else:
            values = q[state]
            best = np.flatnonzero(values == values.max())
            action = int(best[0]) if len(best) == 1 else int(rng.choice(best))
        after, reward, terminated, truncated, _ = env.step(action)
        ahead = 0.0 if terminated else q[after].max()
        q[state, action] += 0.1 * (reward + 0.99 * ahead - q[state, action])
        state = after
        if terminated or truncated:
            state, _ = env.reset()
    return time.process_time() - began


for line in sys.stdin:
    print(json.dumps({"seconds": learn(**json.loads(line))}), flush=True)
