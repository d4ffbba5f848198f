"""Environments with different episodes, for vector environments; some of them fail."""

import copy
import os
import threading

import gymnasium
import numpy as np

from faulty_envs.odd_spaces import SPACES


class Uneven(gymnasium.Env):
    """Its seed decides how long each episode lasts; its infos vary."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 30}  # noqa: RUF012

    def __init__(self, space="Box", longest=4, render_mode=None):
        self.observation_space, self.action_space = (copy.deepcopy(SPACES[space]) for _ in "oa")
        self.longest, self.render_mode = longest, render_mode
        self.left = 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.left = int(self.np_random.integers(1, self.longest + 1))
        return self.observe(), {"left": self.left, "options": options}

    def observe(self):
        self.observation_space.seed(int(self.np_random.integers(2**31)))
        return self.observation_space.sample()

    def step(self, action):
        self.left -= 1
        info = {"left": self.left, "action": repr(action)}
        if self.left % 2:
            numbers = np.array([self.left, -self.left], dtype=np.int16)
            info["odd"] = {"half": self.left / 2, "numbers": numbers, "yes": True}
        ended = self.left == 0
        by_chance = bool(self.np_random.integers(2))
        reward = float(self.np_random.normal())
        return self.observe(), reward, ended and by_chance, ended and not by_chance, info

    def render(self):
        return np.full((2, 2, 3), self.left, dtype=np.uint8)


class KillsItself(Uneven):
    """Ends its process in the second step."""

    def step(self, action):
        if self.left == 1:
            os._exit(3)
        self.left = 2
        return super().step(action)


class CannotSaySo(Uneven):
    """Raises an exception that cannot be sent to another process."""

    def step(self, action):
        failure = RuntimeError("here")
        failure.lock = threading.Lock()
        raise failure


class SpoilsOneSubEnv(Uneven):
    """Fails in the sub-environment with the longest episodes."""

    def step(self, action):
        if self.left == self.longest:
            raise ValueError("too long")
        return super().step(action)


class Insists(Uneven):
    """Accepts only members of its action space, and sometimes not even those."""

    def step(self, action):
        assert self.action_space.contains(action), "no action"
        assert self.left > 1, "too late"
        return super().step(action)
