"""The one thread that draws, and pictures as PNG.

pygame is one per process: an environment's ``close()`` calls ``pygame.quit()``, which takes
the fonts of all the others away, and an OpenGL context belongs to the thread that made it.
So everything that draws or closes runs here, and pygame ends with the process.
"""

from __future__ import annotations

import struct
import sys
import threading
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from typing import TypeVar

import numpy as np

ResultT = TypeVar("ResultT")


# How often who waits for the render thread is asked whether to wait on.
_BETWEEN_QUESTIONS = 0.02


class Occupied(Exception):  # noqa: N818
    """The render thread has other things to do."""


class RenderThread:
    """Runs one piece of drawing or closing after the other."""

    def __init__(self) -> None:
        """Start no thread yet: a server that never draws has none."""
        self._executor = ThreadPoolExecutor(max_workers=1, thread_name_prefix="render")
        self._here = threading.local()

    def run(self, draw: Callable[..., ResultT], *args: object) -> ResultT:
        """Run a function on the render thread; return its result or raise what it raises."""
        if getattr(self._here, "is_render_thread", False):
            # Drawing calls for drawing, as a monitor does of an environment that always draws.
            return draw(*args)
        return self._executor.submit(self._draw, draw, *args).result()

    def run_while(
        self, patient: Callable[[], bool], draw: Callable[..., ResultT], *args: object
    ) -> ResultT:
        """Run a function on the render thread, unless its turn takes too long to come.

        Args:
            patient: tells whether to wait on; asked every 20 ms until the function begins.
            draw: the function.
            *args: what it is called with.

        Raises:
            Occupied: it does not run.
        """
        future = self._executor.submit(self._draw, draw, *args)
        while not wait([future], _BETWEEN_QUESTIONS).done:
            if not patient() and future.cancel():
                raise Occupied
        return future.result()

    def _draw(self, draw: Callable[..., ResultT], *args: object) -> ResultT:
        self._here.is_render_thread = True
        return _keep_pygame_and(draw, *args)

    def stop(self) -> None:
        """Let what is queued finish, and end the thread."""
        self._executor.shutdown()


def _keep_pygame_and(draw: Callable[..., ResultT], *args: object) -> ResultT:
    # Environments import pygame when they first draw and quit it when they close, so looking
    # before each piece of work is early enough, and a server that never draws never pays for
    # the import.
    if "pygame" in sys.modules:
        import pygame

        pygame.quit = pygame.display.quit = _quit_later
    return draw(*args)


def _quit_later() -> None:
    """Stand in for pygame's quit, which pygame itself runs when the process ends."""


_COLOUR_TYPES = {1: 0, 3: 2, 4: 6}


def picture(frame: object) -> np.ndarray:
    """Return what an environment drew as a uint8 array of shape (height, width, channels).

    Args:
        frame: uint8 array of shape (height, width), (height, width, 1), (height, width, 3) for
            RGB or (height, width, 4) for RGBA.

    Raises:
        ValueError: for anything else.
    """
    if not isinstance(frame, np.ndarray):
        raise ValueError(f"no picture: {type(frame).__name__}")
    if frame.ndim == 2:
        frame = frame[:, :, np.newaxis]
    if frame.dtype != np.uint8 or frame.ndim != 3 or frame.shape[2] not in _COLOUR_TYPES:
        raise ValueError(f"no picture: {frame.dtype} of shape {frame.shape}")
    return frame


def png(frame: np.ndarray) -> bytes:
    """Return a ``picture()`` as a PNG file."""
    height, width, channels = frame.shape
    # Each row starts with the number of its filter: 0, none.
    rows = np.zeros((height, 1 + width * channels), dtype=np.uint8)
    rows[:, 1:] = frame.reshape(height, width * channels)
    header = struct.pack(">2I5B", width, height, 8, _COLOUR_TYPES[channels], 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + _chunk(b"IHDR", header)
        + _chunk(b"IDAT", zlib.compress(rows.tobytes(), 1))
        + _chunk(b"IEND", b"")
    )


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
