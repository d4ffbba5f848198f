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
