"""Environments that take long, or never return."""

import multiprocessing
import os
import time
from pathlib import Path

import numpy as np

from faulty_envs.counting import Counting


class Hanging(Counting):
    def step(self, action):
        time.sleep(3600)


class Meeting(Counting):
    """A step adds a file to a directory, and waits until the directory has a number of files."""

    def __init__(self, directory, count):
        super().__init__()
        self.directory, self.count = Path(directory), count

    def step(self, action):
        (self.directory / f"{os.getpid()}-{id(self)}").touch()
        end = time.monotonic() + 20
        while len(list(self.directory.iterdir())) < self.count:
            if time.monotonic() > end:
                raise RuntimeError("The others did not come")
            time.sleep(0.01)
        return super().step(action)


class Gated(Counting):
    """Waits until a test lets it continue, in the method that its kwarg names.

    With "init elsewhere", in the constructor in a process that another one has started. It creates
    a file "begun" in a directory, and waits for a file "open".
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 30}  # noqa: RUF012

    def __init__(self, directory, where="step", render_mode=None, **kwargs):
        super().__init__(**kwargs)
        self.directory, self.where, self.render_mode = Path(directory), where, render_mode
        self.wait("init")
        if multiprocessing.parent_process() is not None:
            self.wait("init elsewhere")

    def wait(self, here):
        if self.where != here:
            return
        (self.directory / "begun").touch()
        end = time.monotonic() + 60
        while not (self.directory / "open").exists():
            if time.monotonic() > end:
                raise RuntimeError("Nobody let it go on")
            time.sleep(0.01)

    def reset(self, *, seed=None, options=None):
        self.wait("reset")
        return super().reset(seed=seed, options=options)

    def step(self, action):
        self.wait("step")
        return super().step(action)

    def render(self):
        self.wait("render")
        return np.zeros((2, 2, 3), dtype=np.uint8)

    def close(self):
        self.wait("close")
