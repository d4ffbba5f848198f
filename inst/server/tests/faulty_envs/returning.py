"""An environment that returns given values."""

import numpy as np

from faulty_envs.counting import Counting


class Returning(Counting):
    """Returns a given reward, as an array, and info; an info of a reset only on request."""

    def __init__(self, reward=1.5, info=None, in_reset=False):
        super().__init__()
        self.reward, self.info, self.in_reset = np.array(reward), info, in_reset

    def reset(self, *, seed=None, options=None):
        observation, _ = super().reset(seed=seed)
        return observation, self.info if self.in_reset else {}

    def step(self, action):
        observation, _, terminated, truncated, _ = super().step(action)
        return observation, self.reward, np.array([terminated]), np.array([truncated]), self.info
