"""Batch Q-learning as a plain loop over logged steps, with a NumPy table.

Reads lines with a JSON object (file, sweeps, discount) and answers each with the processor's
seconds. The file has the columns state, action, reward, after (-1 where the episode ends).
"""

import csv
import json
import sys
import time

import numpy as np


def learn(file: str, sweeps: int, discount: float) -> float:
    """Sweep over all steps this many times, and return the CPU seconds."""
    with open(file, newline="") as lines:
        rows = [
            (int(row["state"]), int(row["action"]), float(row["reward"]), int(row["after"]))
            for row in csv.DictReader(lines)
        ]
    shape = (1 + max(row[0] for row in rows), 1 + max(row[1] for row in rows))
    began = time.process_time()
    q = np.zeros(shape)
    for _ in range(sweeps):
        total = np.zeros(shape)
        count = np.zeros(shape)
        for state, action, reward, after in rows:
            ahead = 0.0 if after < 0 else q[after].max()
            total[state, action] += reward + discount * ahead
            count[state, action] += 1
        q = total / np.maximum(count, 1)
    return time.process_time() - began


for line in sys.stdin:
    print(json.dumps({"seconds": learn(**json.loads(line))}), flush=True)
