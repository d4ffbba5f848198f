"""Choose how many processes run the sub-environments of a vector environment.

A message to a process and the answer take about 0.1 ms, whatever their contents. So processes pay
off if the steps of a group take longer than that. The choice never affects the results, which are
the same for any number of processes.
"""

from __future__ import annotations

from gymnasium.envs.registration import EnvSpec

from gym_server.envs import registry
from gym_server.envs.config import EnvConfig
from gym_server.processes.cores import usable_cores

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
# Of other packages, which by default have one process for all sub-environments.
_OTHER_STEP_SECONDS = 100e-6


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


def choose_num_workers(config: EnvConfig, spec: EnvSpec) -> int:
    """Return how many processes run the sub-environments.

    Args:
        config: what the client chose, and the largest number allowed.
        spec: the environment's spec.
    """
    most = min(most_workers(config), config.max_workers)
    if config.wants_workers:
        return most
    if most < 2:
        return 0
    module = registry.module_of(spec)
    seconds = next(
        (known for beginning, known in _STEP_SECONDS.items() if module.startswith(beginning)),
        _OTHER_STEP_SECONDS,
    )
    chosen = min(most, int((config.num_envs or 1) * seconds / _LEAST_SECONDS))
    return chosen if chosen > 1 else 0
