"""Environments that take much memory, or all that their process may have."""

import threading

from faulty_envs.counting import Counting


class Hoards(Counting):
    """Takes memory, or threads, until the system gives no more, at a place that its kwargs name."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 30}  # noqa: RUF012

    def __init__(self, what="large", at="step", render_mode=None, **kwargs):
        super().__init__(**kwargs)
        self.what, self.at, self.render_mode = what, at, render_mode
        self.act("constructor")

    def act(self, at):
        if at == self.at:
            hoard = []
            enough = threading.Event()
            try:
                while True:
                    hoard.append(getattr(self, self.what)(enough))
            finally:
                enough.set()

    def large(self, _):
        return bytearray(2**23)

    def small(self, _):
        return bytes(100)

    def threads(self, enough):
        thread = threading.Thread(target=enough.wait)
        thread.start()
        return thread

    def reset(self, *, seed=None, options=None):
        self.act("reset")
        return super().reset(seed=seed, options=options)

    def step(self, action):
        self.act("step")
        return super().step(action)

    def render(self):
        self.act("render")


class Large(Counting):
    """Keeps some memory."""

    def __init__(self, megabytes):
        super().__init__()
        self.kept = bytearray(megabytes * 2**20)
