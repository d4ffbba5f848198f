"""What the environment gets, and what is kept."""

import numpy as np
from gymnasium.spaces import Box

from gym_server.policies import read_policy
from gym_server.rollouts.episode import play_episode
from gym_server.rollouts.group import play_group
from gym_server.rollouts.recording import Recorder
from gym_server.rollouts.task import Keep, Unit

STEPS = Keep(steps=True)


class Noting:
    """Notes each action; as a single environment, or with two sub-environments."""

    single_observation_space = Box(0, 1, (1,), np.float32)
    single_action_space = Box(-1, 1, (2,), np.float32)

    def __init__(self, *rows):
        self.rows, self.num_envs, self.actions = rows, sum(rows), []

    def reset(self, seed):
        return np.ones((*self.rows, 1), np.float32), {}

    def step(self, action):
        self.actions.append(action)
        flags = np.zeros(self.rows, bool)
        return np.ones((*self.rows, 1), np.float32), np.zeros(self.rows), flags, flags, {}


def wide_policy(env):
    document = {
        "kind": "network", "sizes": [1, 2], "activation": ["identity"], "output": "gaussian",
    }  # fmt: skip
    tensors = {"weights": np.zeros((1, 2)), "deviation": np.full(2, 9.0)}
    return read_policy(document, tensors, env.single_observation_space, env.single_action_space)


def check_kept_as_drawn(stepped, kept):
    assert abs(kept).max() > 3
    np.testing.assert_array_equal(stepped, np.clip(kept, -1, 1))


def test_what_a_policy_draws_is_kept_as_drawn_and_cut_when_it_is_stepped():
    env = Noting()
    recorder = Recorder(STEPS, env.single_observation_space, env.single_action_space)
    recorder.begin()
    play_episode(env, wide_policy(env).actor(0), 1, 20, recorder)
    recorder.end()
    check_kept_as_drawn(np.array(env.actions), recorder.tensors()["action"].array())


def test_so_it_is_in_a_group():
    env = Noting(2)
    actor = wide_policy(env).actor(np.zeros(2, int))
    played = play_group(env, actor, Unit(1, (0, 0), (0, 1)), 20, STEPS)
    stepped = np.array(env.actions).swapaxes(0, 1).reshape(-1, 2)
    check_kept_as_drawn(stepped, played["action"].array())
