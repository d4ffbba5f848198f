"""Environments that raise errors."""

import multiprocessing
import os
import sys

from faulty_envs.counting import Counting


class RaisesInConstructor(Counting):
    def __init__(self):
        raise RuntimeError("no such table")


class RaisesInReset(Counting):
    def reset(self, *, seed=None, options=None):
        if not (options or {}).get("fix"):
            raise RuntimeError("the cart is gone")
        return super().reset(seed=seed, options=options)


class RaisesInStep(Counting):
    def step(self, action):
        if action == 1:
            raise ValueError("the pole broke")
        return super().step(action)


class ImportsInStep(Counting):
    def step(self, action):
        super().step(action)
        raise ImportError("the pole is not installed")


class ExitsInStep(Counting):
    def step(self, action):
        sys.exit("good bye")


class RaisesInClose(Counting):
    def close(self):
        raise RuntimeError("stuck")


class Variables(Counting):
    """Returns the environment variables of its process."""

    def __init__(self):
        raise ValueError(dict(os.environ))


class RaisesElsewhere(Counting):
    """Cannot be made in a child process."""

    def __init__(self, seconds=0.001):
        super().__init__(seconds)
        if multiprocessing.parent_process() is not None:
            raise RuntimeError("not here")
