"""The one thread that draws.

There is one pygame per process: an environment's ``close()`` calls ``pygame.quit()``, which removes
the fonts of all other environments. An OpenGL context belongs to the thread that created it. So all
drawing, and closing of what was drawn, runs here, and pygame ends with the process.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from threading import get_ident
from typing import TypeVar

from gym_server import memory
from gym_server.threads import calls

ResultT = TypeVar("ResultT")


class RenderThread:
    """Runs drawing and closing functions one after another."""

    def __init__(self) -> None:
        """Start no thread yet: a server that never draws needs none."""
        self._executor = ThreadPoolExecutor(1, "render", self._note_thread)
        self._thread = 0

    def _note_thread(self) -> None:
        self._thread = get_ident()

    def run(self, draw: Callable[..., ResultT], *args: object) -> ResultT:
        """Run a function on the render thread; return its result or raise its exception."""
        if get_ident() == self._thread:
            # Drawing may call for drawing, for example in a monitored environment.
            return draw(*args)
        with calls.waiting() as describe:
            with memory.for_threads():
                future = self._executor.submit(_do, describe or (lambda: "Drawing"), draw, *args)
            return future.result()

    def close(self, close: Callable[[], object], drawn: bool) -> None:
        """Close an environment: on the render thread if it has drawn, else in this thread."""
        if drawn:
            self.run(close)
        else:
            _keep_pygame_and(close)

    def stop(self) -> None:
        """Finish the queued functions, and end the thread."""
        self._executor.shutdown()


def _do(describe: Callable[[], str], draw: Callable[..., ResultT], *args: object) -> ResultT:
    with calls.call(describe):
        return _keep_pygame_and(draw, *args)


def _keep_pygame_and(draw: Callable[..., ResultT], *args: object) -> ResultT:
    # Environments import pygame when they first draw and quit it when they close. Checking before
    # each job is early enough, and a server that never draws never pays for the import.
    if "pygame" in sys.modules:
        import pygame

        pygame.quit = pygame.display.quit = _quit_later
    return draw(*args)


def _quit_later() -> None:
    """Replace pygame's quit functions; pygame runs its own at the end of the process."""
