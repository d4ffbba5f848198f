import numpy as np
from faulty_envs import Counting
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from gym_server.rendering.render_thread import RenderThread
from gym_server.vector_envs.entry_point import EntryPointEnv


class KeepsResults(VectorEnv):
    """Returns the same arrays in every step, and changes them in place."""

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012
    num_envs = 2
    single_action_space = Counting.action_space
    single_observation_space = Counting.observation_space
    action_space = batch_space(single_action_space, 2)
    observation_space = batch_space(single_observation_space, 2)

    def __init__(self):
        self.observation = np.zeros((2, 1), np.int64)
        self.reward, self.terminated, self.truncated = (
            np.zeros(2, dtype) for dtype in (np.float64, bool, bool)
        )

    def step(self, actions):
        self.reward += 1
        for ended in (self.terminated, self.truncated):
            np.logical_not(ended, out=ended)
        return self.observation, self.reward, self.terminated, self.truncated, {}


def test_results_of_a_step_stay_when_the_next_one_changes_them_in_place():
    env = EntryPointEnv(KeepsResults(), RenderThread())
    _, *results, _ = env.step(None, [0, 0])
    env.step(None, [0, 0])
    assert [result.tolist() for result in results] == [[1.0, 1.0], [True, True], [True, True]]


class LikeJax(KeepsResults):
    """Resets and pays like Gymnasium's JAX implementation: each episode ends after two steps."""

    def __init__(self):
        super().__init__()
        self.prev_done = np.zeros(2, bool)
        self.steps = np.zeros(2, np.int64)

    def reset(self, *, seed=None, options=None):
        # It forgets prev_done.
        self.steps = np.zeros(2, np.int64)
        return self.steps[:, None], {}

    def step(self, actions):
        self.steps = np.where(self.prev_done, 0, self.steps + 1)
        self.prev_done = (self.steps == 2) & ~self.prev_done
        return self.steps[:, None], np.ones(2), self.prev_done, np.zeros(2, bool), {}


def test_a_step_that_starts_an_episode_pays_nothing():
    env = EntryPointEnv(LikeJax(), RenderThread())
    env.reset(1, None, None)
    rewards = [env.step(None, [0, 0])[1].tolist() for _ in range(4)]
    assert rewards == [[1, 1], [1, 1], [0, 0], [1, 1]]


def test_a_reset_starts_an_episode_whatever_was_before():
    env = EntryPointEnv(LikeJax(), RenderThread())
    for _ in range(2):
        env.reset(1, None, None)
        steps = [env.step(None, [0, 0]) for _ in range(2)]
        assert [step[0].tolist() for step in steps] == [[[1], [1]], [[2], [2]]]
        assert [step[1].tolist() for step in steps] == [[1, 1], [1, 1]]
