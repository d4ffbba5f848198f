"""An environment that ends its process, or attacks it."""

import ctypes
import os
import signal
import time

import numpy as np

from faulty_envs.counting import Counting


class Rogue(Counting):
    """Attacks its process, in a way and at a place that its kwargs name."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 30}  # noqa: RUF012

    def __init__(self, does="nothing", at="step", render_mode=None, **kwargs):
        super().__init__(**kwargs)
        self.does, self.at, self.render_mode = does, at, render_mode
        self.act("constructor")

    def act(self, at):
        if at == self.at:
            getattr(self, self.does)()

    def reset(self, *, seed=None, options=None):
        self.act("reset")
        observation, info = super().reset(seed=seed, options=options)
        return observation, {**info, "pid": os.getpid()}

    def step(self, action):
        self.act("step")
        return super().step(action)

    def render(self):
        self.act("render")
        return np.zeros((2, 2, 3), np.uint8)

    def close(self):
        self.act("close")

    def nothing(self):
        pass

    def exits(self):
        os._exit(7)

    def interrupts(self):
        raise KeyboardInterrupt("by hand")

    def leaves(self):
        raise SystemExit(3)

    def ends_a_generator(self):
        raise GeneratorExit

    def is_killed(self):
        os.kill(os.getpid(), signal.SIGKILL)

    def crashes(self):
        ctypes.string_at(0)

    def closes_all_files(self):
        os.closerange(0, 4096)

    def ignores_sigterm(self):
        signal.signal(signal.SIGTERM, signal.SIG_IGN)

    def prints(self):
        print("hello" * 1000, flush=True)
        os.write(1, b"to the first descriptor\n")

    def forks_and_exits(self):
        if os.fork() == 0:
            time.sleep(3600)
        os._exit(8)

    def forks_a_stranger_and_exits(self):
        if os.fork() == 0:
            os.setsid()
            time.sleep(8)
            os._exit(0)
        os._exit(8)

    def never_returns(self):
        # No other thread of its process runs meanwhile.
        ctypes.PyDLL(None).sleep(3600)
