"""Environments for the R tests that no package registers.

Made on a server that was started with `--allow-module odd_environments`.
"""

import ctypes
import time

import gymnasium as gym
import numpy as np
from gymnasium import spaces


class Odd(gym.Env):
    """Returns values that a test wants to receive; never ends."""

    def __init__(self, observation_space, action_space=None, observation=None):
        self.observation_space = observation_space
        self.action_space = action_space or spaces.Discrete(2)
        self.observation = observation

    def _observe(self):
        if self.observation is None:
            return self.observation_space.sample()
        return self.observation

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self._observe(), {}

    def step(self, action):
        return self._observe(), 1.0, False, False, {}


class Echo(Odd):
    """The observation is the last action."""

    def step(self, action):
        self.observation = np.asarray(action, dtype=self.observation_space.dtype)
        return super().step(action)


class Failing(Odd):
    """Raises when action 1 is taken."""

    def step(self, action):
        if action == 1:
            raise RuntimeError("the pole caught fire")
        return super().step(action)


class OutOfMemory(Odd):
    """Ends its process as a C++ library that gets no memory does."""

    def __init__(self):
        super().__init__(spaces.Discrete(2))

    def step(self, action):
        ctypes.CDLL("libstdc++.so.6")._Znwm(ctypes.c_size_t(2**62))


class FailsLater(Odd):
    """Raises in the third step of every episode whose seed is divisible by five."""

    def reset(self, *, seed=None, options=None):
        self.seed, self.steps = seed, 0
        self.observation = 0
        return super().reset(seed=seed)

    def step(self, action):
        self.steps += 1
        if self.steps == 3 and self.seed % 5 == 0:
            raise RuntimeError("the pole caught fire")
        return super().step(action)


class Slow(Odd):
    """Each step takes two seconds."""

    def step(self, action):
        time.sleep(2)
        return super().step(action)


class Telling(Odd):
    """Its info and reward have values of many types."""

    def step(self, action):
        info = {
            "action_mask": np.array([1, 0, 1], dtype=np.int8),
            "words": ["a", "é"],
            "nested": {"x": np.float32(0.5), "nothing": None},
            "nan": float("nan"),
            "grid": np.arange(6).reshape(2, 3),
        }
        return self._observe(), float("inf"), False, True, info


class Chatty(Odd):
    """Prints a lot."""

    def step(self, action):
        print("x" * 20_000)
        return super().step(action)


class Drawing(Odd):
    """Draws a dot that moves in each step, on a grey, coloured or half transparent background."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(self, channels, render_mode=None):
        super().__init__(spaces.Discrete(2))
        self.render_mode = render_mode
        self.channels = channels
        self.steps = 0

    def reset(self, *, seed=None, options=None):
        self.steps = 0
        return super().reset(seed=seed)

    def step(self, action):
        self.steps += 1
        observation, reward, _, truncated, info = super().step(action)
        return observation, reward, self.steps == 5, truncated, info

    def render(self):
        frame = np.full((4, 6, self.channels), 100, dtype=np.uint8)
        frame[1, self.steps] = np.array([10, 20, 30, 255])[: self.channels]
        return frame


def box(low, high, shape, dtype):
    return spaces.Box(low, high, shape, dtype)


def image():
    """Return an image that counts row by row, so that swapped axes are noticed."""
    return Odd(
        box(0, 255, (2, 3, 4), np.uint8),
        observation=np.arange(24, dtype=np.uint8).reshape(2, 3, 4),
    )


def large_integers():
    limits = np.iinfo(np.int64)
    values = np.array([-1, 2**53 + 1, limits.max], dtype=np.int64)
    return Odd(box(limits.min, limits.max, (3,), np.int64), observation=values)


def smallest_integer():
    limits = np.iinfo(np.int64)
    values = np.array([0, limits.min], dtype=np.int64)
    return Odd(box(limits.min, limits.max, (2,), np.int64), observation=values)


def largest_natural():
    values = np.array([2**64 - 1], dtype=np.uint64)
    return Odd(box(0, 2**64 - 1, (1,), np.uint64), observation=values)


def middling_integers():
    values = np.array([-(2**31), 2**31, 2**53 - 1], dtype=np.int64)
    return Odd(box(-(2**53), 2**53, (3,), np.int64), observation=values)


def not_finite():
    values = np.array([np.nan, np.inf, -np.inf, 1 / 3], dtype=np.float64)
    return Odd(box(-np.inf, np.inf, (4,), np.float64), observation=values)


def echo():
    space = box(-np.inf, np.inf, (2, 3), np.float64)
    return Echo(space, space, np.zeros((2, 3)))


def lopsided():
    low = np.array([-np.inf, 0.0, -1.0])
    high = np.array([np.inf, np.inf, 1.0])
    space = spaces.Box(low, high, dtype=np.float64)
    return Odd(space, space)


def one_number():
    return Odd(box(-1, 1, (1,), np.float32), box(-1, 1, (), np.float32))


def shifted():
    return Odd(spaces.Discrete(3, start=-1), spaces.Discrete(3, start=5))


class Parts(gym.Env):
    """Pays for the number of the state, and for twice this number."""

    observation_space = spaces.Discrete(2)
    action_space = spaces.Dict({"left": spaces.Discrete(2), "right": spaces.Discrete(3)})

    def _observe(self):
        self.state = self.np_random.integers(2)
        return self.state

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self._observe(), {}

    def step(self, action):
        reward = float(action["left"] == self.state) + float(action["right"] == 2 * self.state)
        return self._observe(), reward, False, False, {}


class Riddle(spaces.Space):
    """An unknown kind of space."""


def riddle():
    return Odd(Riddle())


def nested():
    position = box(-1, 1, (3,), np.float64)
    return Odd(spaces.Discrete(2), spaces.Dict({"position": position, "a.b": spaces.Discrete(2)}))


def failing():
    return Failing(spaces.Discrete(2))


def fails_later():
    return FailsLater(spaces.Discrete(2))


def slow():
    return Slow(spaces.Discrete(2))


def slow_to_make(seconds=2):
    time.sleep(seconds)
    return Odd(spaces.Discrete(2))


def telling():
    return Telling(spaces.Discrete(2))


def chatty():
    return Chatty(spaces.Discrete(2))


for maker in (
    image,
    large_integers,
    smallest_integer,
    largest_natural,
    middling_integers,
    not_finite,
    echo,
    lopsided,
    one_number,
    shifted,
    riddle,
    nested,
    failing,
    fails_later,
    slow,
    slow_to_make,
    telling,
    chatty,
):
    name = "".join(word.title() for word in maker.__name__.split("_"))
    gym.register(f"{name}-v0", entry_point=maker, disable_env_checker=True)

gym.register("Parts-v0", entry_point=Parts, max_episode_steps=4, disable_env_checker=True)
gym.register("OutOfMemory-v0", entry_point=OutOfMemory, disable_env_checker=True)

for channels in (1, 3, 4):
    gym.register(
        f"Drawing{channels}-v0",
        entry_point=Drawing,
        kwargs={"channels": channels},
        disable_env_checker=True,
    )
