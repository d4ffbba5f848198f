"""An environment that has played an episode plays the next one like a new environment.

``GYM_TEST_ENVIRONMENTS=all``, which ``make soak`` sets, plays older versions, too.
"""

import environments
import gymnasium
import numpy as np
import pytest
from gymnasium.envs.classic_control.cartpole import CartPoleVectorEnv
from gymnasium.envs.registration import EnvSpec

from gym_server.envs.config import EnvConfig, Wrapper
from gym_server.policies import read_policy
from gym_server.rollouts import environment
from gym_server.rollouts.group import play_group
from gym_server.rollouts.task import Keep, Task, Unit

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


def task(env_id, kwargs, wrappers):
    # Environments with wrappers are not played in groups.
    limit = Wrapper("TimeLimit", {"max_episode_steps": 10_000})
    config = EnvConfig(env_id, kwargs=kwargs, wrappers=(*wrappers, limit))
    return Task(config, frozenset(), np.inf)


def differs(env_id, kwargs=None, wrappers=()):
    """Return whether the third episode of an environment differs from that in a new one."""
    kept = environment.RolloutEnv(task(env_id, kwargs, wrappers))
    for seed in (1, 2):
        episode(kept.for_an_episode(), seed)
    new = environment.RolloutEnv(task(env_id, kwargs, wrappers))
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


def test_bipedal_walker_must_be_made_anew(monkeypatch):
    monkeypatch.setattr(environment, "_KEPT", ("gymnasium.envs.box2d",))
    assert differs("BipedalWalker-v3")


class Remembering(gymnasium.Env):
    """Observes how many episodes it has played, like nothing that Gymnasium has."""

    observation_space = gymnasium.spaces.Discrete(9)
    action_space = gymnasium.spaces.Discrete(2)
    episodes = 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.episodes += 1
        return self.episodes, {}

    def step(self, action):
        return self.episodes, 0.0, True, False, {}


def test_what_no_test_has_compared_is_made_anew(monkeypatch):
    # As if a later Gymnasium had it.
    monkeypatch.setattr(Remembering, "__module__", "gymnasium.envs.later.remembering")
    spec = EnvSpec("Remembering-v0", entry_point=Remembering)
    monkeypatch.setitem(gymnasium.registry, "Remembering-v0", spec)
    assert not differs("Remembering-v0")


P = "Pendulum-v1"
CHANGED = [
    ("LunarLander-v3", {"enable_wind": True}, ()),
    ("Taxi-v4", {"is_rainy": True, "fickle_passenger": True}, ()),
    ("CliffWalking-v1", {"is_slippery": True}, ()),
    (P, {}, Wrapper("AddWhiteNoise", {"probability_of_noise_per_pixel": 0.5})),
    (P, {}, Wrapper("DelayObservation", {"delay": 3})),
    (P, {}, Wrapper("FrameStackObservation", {"stack_size": 4})),
    (P, {}, Wrapper("RecordEpisodeStatistics", {})),
    (P, {}, Wrapper("RepeatAction", {"num_repeats": 3})),
    (P, {}, Wrapper("StickyAction", {"repeat_action_probability": 0.5})),
    (P, {}, Wrapper("TimeAwareObservation", {})),
    ("CartPole-v1", {}, Wrapper("MaxAndSkipObservation", {"skip": 4})),
]


@pytest.mark.slow
@pytest.mark.parametrize(("env_id", "kwargs", "wrapper"), CHANGED)
def test_one_with_arguments_or_wrappers_that_keep_something_plays_as_a_new_one(
    env_id, kwargs, wrapper
):
    assert not differs(env_id, kwargs, (wrapper,) if wrapper else ())


def test_a_kept_group_plays_as_a_new_one():
    task = Task(EnvConfig("CartPole-v1"), frozenset(), np.inf)

    def play(env, seed):
        actor = read_policy({"kind": "random"}, {}, env.observation_space, env.action_space).actor(
            np.zeros(env.group, dtype=int)
        )
        unit = Unit(seed, (0,) * 20, tuple(range(20)))
        return play_group(env.env, actor, unit, 60, Keep())["length"].array().tolist()

    kept = environment.RolloutEnv(task)
    first = play(kept, 1)
    play(kept, 2)
    assert play(kept, 1) == first


def test_no_implementation_plays_in_groups_that_no_test_has_compared(monkeypatch):
    later = type("Later", (CartPoleVectorEnv,), {"__module__": "gymnasium.envs.later.cartpole"})
    spec = EnvSpec("Later-v0", entry_point=Remembering, vector_entry_point=later)
    monkeypatch.setattr(Remembering, "__module__", "gymnasium.envs.later.remembering")
    monkeypatch.setitem(gymnasium.registry, "Later-v0", spec)
    env = environment.RolloutEnv(Task(EnvConfig("Later-v0"), frozenset(), np.inf))
    assert env.group is None
