"""The contender Python: loops in process, in the server's Python.

Reads a line per request and answers with one, env steps per second (or the requested value):

    versions                       as JSON
    single SECONDS
    vector SECONDS NUM_ENVS MODE   MODE is Gymnasium's vectorization_mode
    episodes ENV_ID KIND FILE OUTPUTS POLICIES EPISODES
                                   EPISODES with each of the POLICIES whose numbers are in FILE;
                                   see tasks.R
"""

import json
import os
import platform
import re
import sys
import time
from functools import cache
from importlib import metadata

import gymnasium
import numpy as np
from episodes import count_steps, make_policies


def single(seconds: str) -> float:
    """Play one environment, step by step."""
    env = _single_env()
    env.reset()
    steps = 0
    started = time.perf_counter()
    while True:
        for i in range(100):
            _, _, terminated, truncated, _ = env.step(i % 2)
            if terminated or truncated:
                env.reset()
        steps += 100
        elapsed = time.perf_counter() - started
        if elapsed >= float(seconds):
            return steps / elapsed


def vector(seconds: str, number: str, mode: str) -> float:
    """Play a vector environment."""
    envs = _vector_env(int(number), mode)
    actions = [(np.arange(int(number)) + i) % 2 for i in range(2)]
    steps = 0
    started = time.perf_counter()
    while True:
        for i in range(10):
            envs.step(actions[i % 2])
        steps += 10 * int(number)
        elapsed = time.perf_counter() - started
        if elapsed >= float(seconds):
            return steps / elapsed


def episodes(env_id: str, kind: str, file: str, outputs: str, policies: str, number: str) -> float:
    """Play whole episodes in one environment, one after another."""
    played = make_policies(env_id, kind, file, int(outputs), int(policies))
    started = time.perf_counter()
    steps = count_steps(env_id, played, int(number))
    return steps / (time.perf_counter() - started)


@cache
def _single_env() -> gymnasium.Env:
    env = gymnasium.make("CartPole-v1")
    env.reset(seed=1)
    return env


@cache
def _vector_env(number: int, mode: str) -> gymnasium.vector.VectorEnv:
    envs = gymnasium.make_vec("CartPole-v1", num_envs=number, vectorization_mode=mode)
    envs.reset(seed=1)
    return envs


def versions() -> dict:
    """Return the versions of Python and the server's dependencies, including its HTTP server."""
    needed = [
        re.match(r"[\w.-]+", requirement).group()
        for requirement in metadata.requires("gym-server")
        if "extra ==" not in requirement
    ]
    return {
        "Python": platform.python_version(),
        "system": platform.system(),
        "cores": len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else os.cpu_count(),
        **{name: metadata.version(name) for name in needed},
    }


commands = {"versions": versions, "single": single, "vector": vector, "episodes": episodes}
for line in sys.stdin:
    command, *arguments = line.split()
    answer = commands[command](*arguments)
    print(json.dumps(answer), flush=True)
