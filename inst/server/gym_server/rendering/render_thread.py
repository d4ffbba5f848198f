"""The one thread that draws.

There is one pygame per process: an environment's ``close()`` calls ``pygame.quit()``, which removes
the fonts of all other environments. An OpenGL context belongs to the thread that created it. So all
drawing, and closing of what was drawn, runs here, and pygame ends with the process.
"""

from __future__ import annotations

import queue
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

from gym_server import memory
from gym_server.threads import calls

ResultT = TypeVar("ResultT")


class _Job:
    """One piece of work for the render thread.

    Attributes:
        draw: the function to run.
        describe: describes the call that it belongs to.
        future: its result.
    """

    def __init__(self, draw: Callable[[], object], describe: Callable[[], str]) -> None:
        self.draw = draw
        self.describe = describe
        self.future: Future = Future()


class RenderThread:
    """Runs drawing and closing functions one after another."""

    def __init__(self) -> None:
        """Start no thread yet: a server that never draws needs none."""
        self._lock = threading.Lock()
        self._queue: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        self._stopped = False

    def run(self, draw: Callable[..., ResultT], *args: object) -> ResultT:
        """Run a function on the render thread; return its result or raise its exception."""
        if threading.current_thread() is self._thread:
            # Drawing may call for drawing, for example in a monitored environment.
            return draw(*args)
        with calls.waiting() as describe:
            job = _Job(lambda: _keep_pygame_and(draw, *args), describe or (lambda: "Drawing"))
            with self._lock:
                if self._stopped:
                    raise RuntimeError("nothing is drawn any more")
                if self._thread is None:
                    # A daemon, so that drawing that never ends does not keep the process alive.
                    thread = threading.Thread(target=self._work, name="render", daemon=True)
                    memory.start(thread)
                    self._thread = thread
                self._queue.put(job)
            result: ResultT = job.future.result()
            return result

    def close(self, close: Callable[[], object], drawn: bool) -> None:
        """Close an environment: on the render thread if it has drawn, else in this thread."""
        if drawn:
            self.run(close)
        else:
            _keep_pygame_and(close)

    def _work(self) -> None:
        while (job := self._queue.get()) is not None:
            with calls.call(job.describe):
                _do(job)
            # Do not keep the picture until the next job comes.
            job = None

    def stop(self) -> None:
        """Finish the queued jobs, and end the thread."""
        with self._lock:
            self._stopped = True
            self._queue.put(None)
        if self._thread is not None:
            self._thread.join()


def _do(job: _Job) -> None:
    try:
        result = job.draw()
    except BaseException as error:
        job.future.set_exception(error)
    else:
        job.future.set_result(result)


def _keep_pygame_and(draw: Callable[..., ResultT], *args: object) -> ResultT:
    # Environments import pygame when they first draw and quit it when they close. Checking before
    # each job is early enough, and a server that never draws never pays for the import.
    if "pygame" in sys.modules:
        import pygame

        pygame.quit = pygame.display.quit = _quit_later
    return draw(*args)


def _quit_later() -> None:
    """Replace pygame's quit functions; pygame runs its own at the end of the process."""
