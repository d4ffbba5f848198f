"""Environments that draw, and one that cannot draw what the server needs."""

import threading
import time

import numpy as np

from faulty_envs.counting import Counting


class Drawing(Counting):
    """Draws what its kwarg says, and notes which threads draw and close it."""

    threads = set()  # noqa: RUF012

    metadata = {"render_modes": ["rgb_array"], "render_fps": 30}  # noqa: RUF012

    def __init__(self, frame="picture", render_mode=None, **kwargs):
        super().__init__(**kwargs)
        self.frame, self.render_mode = frame, render_mode

    def close(self):
        self.threads.add(threading.get_ident())

    def render(self):
        self.threads.add(threading.get_ident())
        if self.frame == "hangs":
            time.sleep(3600)
        if self.frame == "raises":
            raise RuntimeError("out of paint")
        if self.frame == "nothing":
            return None
        return np.full((16, 32, 3), self.steps, dtype=np.uint8)


class OldRenderModes(Counting):
    metadata = {"render_modes": ["ansi"]}  # noqa: RUF012
