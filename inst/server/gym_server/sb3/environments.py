"""The environments that an algorithm trains in, and is evaluated in."""

from __future__ import annotations

from typing import Any

from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv

from gym_server.envs.make import check_kwargs, find_spec, make_from_spec
from gym_server.errors import GymServerError
from gym_server.sb3.failures import JobError


def vector_env(job: dict[str, Any], count: int) -> VecEnv:
    """Return a vector environment of Stable-Baselines3.

    Args:
        job: the job, with ``env_id`` and ``env_kwargs``.
        count: the number of sub-environments.
    """
    try:
        spec = find_spec(job["env_id"], ())
        check_kwargs(job["env_kwargs"])

        def make() -> Any:
            return Monitor(make_from_spec(spec, None, job["env_kwargs"]))

        made: VecEnv = DummyVecEnv([make] * count)
    except GymServerError as refusal:
        raise JobError(refusal.message, refusal.hint, argument="env") from refusal
    return made
