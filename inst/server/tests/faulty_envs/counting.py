"""A well-behaved environment that most others derive from, and one that changes what it has
returned."""

import time

import gymnasium
import numpy as np
from gymnasium import spaces


class Counting(gymnasium.Env):
    """Observes the number of its steps; an episode lasts ``length`` steps."""

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


class KeepsItsArrays(Counting):
    """Always returns and draws the same objects, and changes them in place.

    It observes the number of steps of the episode.
    """

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012

    def __init__(self, length=3, render_mode=None):
        super().__init__(length=length)
        self.render_mode = render_mode
        self.observation = np.zeros(1, np.int64)
        self.info = {"steps": self.observation, "nested": {"list": [0]}}
        self.frame = np.zeros((1, 1, 3), np.uint8)

    def reset(self, *, seed=None, options=None):
        self.steps = 0
        observation, _ = super().reset(seed=seed, options=options)
        return observation, self.info

    def step(self, action):
        *outcome, _ = super().step(action)
        return *outcome, self.info

    def observe(self):
        self.observation[:] = self.frame[:] = self.info["nested"]["list"][0] = self.steps
        return self.observation

    def render(self):
        return self.frame
