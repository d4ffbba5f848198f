"""The environment that most of the others derive from; it behaves."""

import time

import gymnasium
import numpy as np
from gymnasium import spaces


class Counting(gymnasium.Env):
    """Observes how often it was stepped since it was made; an episode lasts ``length`` steps."""

    observation_space = spaces.Box(0, 2**62, (1,), np.int64)
    action_space = spaces.Discrete(2)

    def __init__(self, seconds=0.0, length=5):
        self.seconds, self.length = seconds, length
        self.steps = self.left = 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.left = self.length
        return self.observe(), {"seed": seed, "options": options}

    def step(self, action):
        time.sleep(self.seconds)
        self.steps += 1
        self.left -= 1
        return self.observe(), 1.5, self.left <= 0, False, {}

    def observe(self):
        return np.array([self.steps], dtype=np.int64)
