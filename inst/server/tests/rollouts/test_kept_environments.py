"""An environment that has played an episode plays the next one like a new environment.

``GYM_TEST_ENVIRONMENTS=all``, which ``make soak`` sets, plays older versions, too.
"""

import environments
import numpy as np
import pytest

from gym_server.envs.config import EnvConfig, Wrapper
from gym_server.rollouts import environment
from gym_server.rollouts.task import Task

LEFT_OUT = environments.ATARI if environments.ALL else environments.ATARI | environments.older()
OTHERS = [env_id for env_id in environments.runnable() if env_id not in LEFT_OUT]
# One of each kind of environment, with short episodes.
SOME = ("BipedalWalker-v3", "FrozenLake-v1", "HalfCheetah-v5", "LunarLander-v3", "Pendulum-v1")
STEPS = 60


def episode(env, seed):
    """Return the observations and rewards of an episode with random actions."""
    generator = np.random.default_rng(seed)
    env.action_space.seed(int(generator.integers(1000)))
    observation, _ = env.reset(seed=seed)
    seen = [np.array(observation)]
    for _ in range(STEPS):
        observation, reward, terminated, truncated, _ = env.step(env.action_space.sample())
        seen += [np.array(observation), np.array(reward)]
        if terminated or truncated:
            break
    return seen


def task(env_id):
    # Environments with wrappers are not played in groups.
    limit = Wrapper("TimeLimit", {"max_episode_steps": 10_000})
    return Task(EnvConfig(env_id, wrappers=(limit,)), frozenset(), np.inf)


def differs(env_id):
    """Return whether the third episode of an environment differs from that in a new one."""
    kept = environment.RolloutEnv(task(env_id))
    for seed in (1, 2):
        episode(kept.for_an_episode(), seed)
    new = environment.RolloutEnv(task(env_id))
    first, second = episode(kept.for_an_episode(), 3), episode(new.for_an_episode(), 3)
    kept.close()
    new.close()
    return len(first) != len(second) or not all(map(np.array_equal, first, second))


@pytest.mark.parametrize(
    "env_id",
    [
        pytest.param(i, marks=[] if i in SOME else [pytest.mark.slow])
        for i in (*OTHERS, *environments.atari_played()[::4])
    ],
)
def test_a_kept_one_plays_as_a_new_one(env_id):
    assert not differs(env_id)


def test_only_those_are_made_anew_that_must_be(monkeypatch):
    monkeypatch.setattr(environment, "_MADE_ANEW", ("nothing",))
    assert differs("BipedalWalker-v3")
