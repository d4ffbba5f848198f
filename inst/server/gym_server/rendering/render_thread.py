"""The one thread that draws.

pygame is one per process: an environment's ``close()`` calls ``pygame.quit()``, which takes
the fonts of all the others away, and an OpenGL context belongs to the thread that made it.
So everything that draws or closes runs here, and pygame ends with the process.
"""

from __future__ import annotations

import contextlib
import queue
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, InvalidStateError, wait
from typing import TypeVar

from gym_server.threads.interrupt import interrupt

ResultT = TypeVar("ResultT")


# How often who waits for the render thread is asked whether to wait on.
_BETWEEN_QUESTIONS = 0.02


class Occupied(Exception):  # noqa: N818
    """The render thread has other things to do."""


class _Job:
    """One piece of work for the render thread.

    Attributes:
        asker: the thread that waits for it.
        future: what becomes of it.
        began: since when it runs, in the clock's seconds; None while it waits for its turn.
    """

    def __init__(self, draw: Callable[[], object]) -> None:
        self.asker = threading.get_ident()
        self.future: Future = Future()
        self.began: float | None = None
        self._draw = draw

    def do(self) -> bool:
        """Do it; return whether anybody still wanted to know when it was done."""
        self.began = time.monotonic()
        if not self.future.set_running_or_notify_cancel():
            return True
        with contextlib.suppress(InvalidStateError):
            try:
                result = self._draw()
            except BaseException as error:
                self.future.set_exception(error)
            else:
                self.future.set_result(result)
            return True
        return False


class RenderThread:
    """Runs one piece of drawing or closing after the other."""

    def __init__(self) -> None:
        """Start no thread yet: a server that never draws has none."""
        self._lock = threading.Lock()
        self._queue: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        self._running: _Job | None = None
        self._stopped = False
        # What each thread waits for.
        self._asked: dict[int, _Job] = {}

    def run(self, draw: Callable[..., ResultT], *args: object) -> ResultT:
        """Run a function on the render thread; return its result or raise what it raises."""
        if threading.current_thread() is self._thread:
            # Drawing calls for drawing, as a monitor does of an environment that always draws.
            return draw(*args)
        with self._ask(draw, *args) as job:
            return job.future.result()

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
        with self._ask(draw, *args) as job:
            while not wait([job.future], _BETWEEN_QUESTIONS).done:
                if not patient() and job.future.cancel():
                    raise Occupied
            return job.future.result()

    @contextlib.contextmanager
    def _ask(self, draw: Callable, *args: object) -> Iterator[_Job]:
        job = _Job(lambda: _keep_pygame_and(draw, *args))
        with self._lock:
            if self._stopped:
                raise RuntimeError("nothing is drawn any more")
            if self._thread is None:
                self._start()
            self._asked[job.asker] = job
            self._queue.put(job)
        try:
            yield job
        finally:
            self._asked.pop(job.asker, None)

    def _start(self) -> None:
        # A daemon: drawing that never ends must not keep the process.
        self._thread = threading.Thread(target=self._work, name="render", daemon=True)
        self._thread.start()

    def _work(self) -> None:
        while (job := self._queue.get()) is not None:
            self._running = job
            if not job.do():
                # Another thread has taken over.
                return
            # What it drew must not stay until the next one comes.
            self._running = job = None

    def began(self, thread: int) -> float | None:
        """Return since when what a thread waits for is being done, in the clock's seconds.

        None when it does not wait for the render thread, now when it waits for its turn.
        """
        job = self._asked.get(thread)
        if job is None:
            return None
        return time.monotonic() if job.began is None else job.began

    def give_up(self, thread: int, why: Exception) -> bool:
        """Draw the rest on another thread, if this one hangs on a thread's behalf.

        Args:
            thread: the one that waits for what is being drawn, or the render thread itself.
            why: what is raised where the drawing was asked for.

        Returns:
            Whether it was so.
        """
        with self._lock:
            job, hanging = self._running, self._thread
            if job is None or hanging is None or thread not in (job.asker, hanging.ident):
                return False
            try:
                job.future.set_exception(why)
            except InvalidStateError:
                return False
            self._running = None
            # Before anything that waits, in which it could end and another get its identity.
            interrupt(hanging.ident)
            self._start()
            return True

    def give_up_what_began_before(self, moment: float, why: Exception) -> bool:
        """Draw the rest on another thread, if this one has been at one thing for too long.

        Args:
            moment: what has run since before it is given up, in the clock's seconds.
            why: what is raised where it was asked for.

        Returns:
            Whether it was so.
        """
        job = self._running
        began = None if job is None else job.began
        return began is not None and began < moment and self.give_up(job.asker, why)

    def stop(self) -> None:
        """Let what is queued finish, and end the thread."""
        with self._lock:
            self._stopped = True
            self._queue.put(None)
        if self._thread is not None:
            self._thread.join()


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
