"""Choose how many processes run the sub-environments of a vector environment.

A message to a process and the answer take about 0.1 ms, whatever their contents. So processes pay
off if the steps of a group take longer than that. The choice never affects the results, which are
the same for any number of processes.
"""

from __future__ import annotations

import json
import threading
import time
from hashlib import blake2b

import gymnasium
from gymnasium.envs.registration import EnvSpec

from gym_server.envs import registry
from gym_server.envs.config import EnvConfig
from gym_server.envs.wrappers import draws_when_stepped
from gym_server.processes.cores import usable_cores
from gym_server.rendering.render_thread import RenderThread
from gym_server.vector_envs.sub_env import SubEnv

# The fewest sub-environments per process, and the least seconds of work per step.
_FEWEST_SUB_ENVS = 16
_LEAST_SECONDS = 0.0005

# Seconds per step, by a prefix of the module's name, specific ones first (Gymnasium 1.4, ale_py
# 0.12, Python 3.11; the median of 3,000 steps with random actions).
_STEP_SECONDS = {
    "gymnasium.envs.toy_text": 5e-6,
    "gymnasium.envs.classic_control.acrobot": 27e-6,
    "gymnasium.envs.classic_control": 8e-6,
    "gymnasium.envs.box2d.bipedal_walker": 100e-6,
    "gymnasium.envs.box2d.car_racing": 2e-3,
    "gymnasium.envs.box2d": 25e-6,
    "gymnasium.envs.mujoco": 30e-6,
    "ale_py": 200e-6,
}
_MEASURED_STEPS = 20

# Clients decide what is measured, so only this many results are remembered, the latest ones.
_MOST_MEASURED = 1000


def most_workers(config: EnvConfig) -> int:
    """Return the largest number of processes that may be chosen for a client's request."""
    num_envs = config.num_envs or 1
    if config.num_workers is not None:
        return config.num_workers
    if config.vectorization_mode == "async":
        return min(num_envs, usable_cores())
    if config.num_envs is None or config.vectorization_mode is not None:
        return 0
    most = min(usable_cores(), num_envs // _FEWEST_SUB_ENVS)
    return most if most > 1 else 0


def choose_num_workers(
    config: EnvConfig, spec: EnvSpec, sub_env: SubEnv, renderer: RenderThread
) -> int:
    """Return how many processes run the sub-environments.

    Args:
        config: what the client chose, and the largest number allowed.
        spec: the environment's spec.
        sub_env: makes a sub-environment, to measure a step if its duration is unknown.
        renderer: the process's render thread.
    """
    most = min(most_workers(config), config.max_workers)
    if config.wants_workers:
        return most
    if most < 2:
        return 0
    work = (config.num_envs or 1) * _step_seconds(spec, config, sub_env, renderer)
    chosen = min(most, int(work / _LEAST_SECONDS))
    return chosen if chosen > 1 else 0


def _step_seconds(
    spec: EnvSpec, config: EnvConfig, sub_env: SubEnv, renderer: RenderThread
) -> float:
    module = registry.module_of(spec)
    for beginning, seconds in _STEP_SECONDS.items():
        if module.startswith(beginning):
            return seconds
    kind = json.dumps([spec.id, config.kwargs, config.wrappers], default=str, sort_keys=True)
    # This text may be as long as a request, so store its hash.
    key = blake2b(kind.encode()).digest()
    known = _measured.get(key)
    if known is not None:
        return known
    measured = _measure(sub_env(), renderer)
    with _lock:
        _measured[key] = measured
        while len(_measured) > _MOST_MEASURED:
            del _measured[next(iter(_measured))]
    return measured


_lock = threading.Lock()
_measured: dict[bytes, float] = {}


def _measure(env: gymnasium.Env, renderer: RenderThread) -> float:
    """Return the seconds per step of an environment, and close it."""
    try:
        env.reset(seed=0)
        env.action_space.seed(0)
        actions = [env.action_space.sample() for _ in range(_MEASURED_STEPS)]
        began = time.perf_counter()
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return (time.perf_counter() - began) / _MEASURED_STEPS
    finally:
        renderer.close(env.close, draws_when_stepped(env))
