"""How many processes run the sub-environments of a vector environment, where nobody said.

A message to a process and its answer cost some 0.1 ms, whatever is in them, so processes pay where
the steps of a group take longer than that. What is chosen never decides what is drawn: any number
of processes gives the same results.
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

# A process has at least so many sub-environments, and so many seconds of work in a step.
_FEWEST_SUB_ENVS = 16
_LEAST_SECONDS = 0.0005

# Seconds of a step, by the beginning of the module's name, the more particular one before the more
# general one (Gymnasium 1.4, ale_py 0.12, Python 3.11; the median of 3,000 steps with random
# actions).
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

# Clients say what is measured: of so many kinds, the latest, the seconds are remembered.
_MOST_MEASURED = 1000


def most_workers(config: EnvConfig) -> int:
    """Return how many processes may be chosen at most for what a client wants."""
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
        config: what the client wants, and the most that may be.
        spec: the environment's.
        sub_env: makes one, to measure a step where that is not known.
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
    # A kind may be as long as a request.
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
    """Return the seconds of a step, of an environment that is closed then."""
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
