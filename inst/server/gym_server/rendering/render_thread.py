"""The one thread that draws.

There is one pygame per process: an environment's ``close()`` calls ``pygame.quit()``, which takes
the fonts of all the others away; and an OpenGL context belongs to the thread that created it.
So everything that draws, or closes what was drawn, runs here, and pygame ends with the process.
"""

from __future__ import annotations

import contextlib
import queue
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, wait
from typing import TypeVar

from gym_server.threads.in_progress import InProgress
from gym_server.threads.interrupt import interrupt

ResultT = TypeVar("ResultT")


# How often a thread that waits for its turn looks whether it may wait on.
_POLL_SECONDS = 0.02


class Occupied(Exception):  # noqa: N818
    """The render thread has other things to do."""


class _Job:
    """One piece of work for the render thread.

    Attributes:
        caller: the thread that waits for the result.
        draw: what is to be done.
        future: the result.
        began: since when it runs, in the clock's seconds; None while it waits for its turn.
    """

    def __init__(self, draw: Callable[[], object]) -> None:
        self.caller = threading.get_ident()
        self.draw = draw
        self.future: Future = Future()
        self.began: float | None = None


class RenderThread:
    """Runs one piece of drawing or closing after the other."""

    def __init__(self) -> None:
        """Start no thread yet: a server that never draws has none."""
        self._lock = threading.Lock()
        self._queue: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        self._running: _Job | None = None
        self._in_progress: InProgress[_Job, None] = InProgress()
        self._stopped = False
        # By the thread that waits for the result.
        self._jobs: dict[int, _Job] = {}

    def run(self, draw: Callable[..., ResultT], *args: object) -> ResultT:
        """Run a function on the render thread; return its result or raise what it raises."""
        if threading.current_thread() is self._thread:
            # Drawing calls for drawing, as a monitor does of an environment that always draws.
            return draw(*args)
        with self._job(draw, *args) as job:
            result: ResultT = job.future.result()
            return result

    def close(self, close: Callable[[], object], drawn: bool) -> None:
        """Close an environment: on the render thread where it was drawn, at once where not."""
        if drawn:
            self.run(close)
        else:
            _keep_pygame_and(close)

    def run_while(
        self, may_wait: Callable[[], bool], draw: Callable[..., ResultT], *args: object
    ) -> ResultT:
        """Run a function on the render thread, unless its turn takes too long to come.

        Args:
            may_wait: tells whether to wait on; asked every 20 ms until the function begins.
            draw: the function.
            *args: what it is called with.

        Raises:
            Occupied: its turn did not come, and it will not run.
        """
        with self._job(draw, *args) as job:
            while not wait([job.future], _POLL_SECONDS).done:
                if not may_wait() and job.future.cancel():
                    raise Occupied
            result: ResultT = job.future.result()
            return result

    @contextlib.contextmanager
    def _job(self, draw: Callable, *args: object) -> Iterator[_Job]:
        job = _Job(lambda: _keep_pygame_and(draw, *args))
        with self._lock:
            if self._stopped:
                raise RuntimeError("nothing is drawn any more")
            if self._thread is None:
                self._start()
            self._jobs[job.caller] = job
            self._queue.put(job)
        try:
            yield job
        finally:
            self._jobs.pop(job.caller, None)

    def _start(self) -> None:
        # A daemon: drawing that never ends must not keep the process.
        self._thread = threading.Thread(target=self._work, name="render", daemon=True)
        self._thread.start()

    def _work(self) -> None:
        while (job := self._queue.get()) is not None:
            self._running = job
            if not self._do(job):
                return
            # The picture must not be kept until the next job comes.
            self._running = job = None

    def _do(self, job: _Job) -> bool:
        """Do a job; return False when another thread has become the render thread meanwhile."""
        job.began = time.monotonic()
        if not job.future.set_running_or_notify_cancel():
            return True
        self._in_progress.begin(job, None)
        try:
            result = job.draw()
        except BaseException as error:
            if not self._in_progress.finish(job):
                return False
            job.future.set_exception(error)
        else:
            if not self._in_progress.finish(job):
                return False
            job.future.set_result(result)
        return True

    def began(self, thread: int) -> float | None:
        """Return since when the job that a thread waits for has been running.

        In the clock's seconds; None when it does not wait for the render thread, now when it
        waits for its turn.
        """
        job = self._jobs.get(thread)
        if job is None:
            return None
        return time.monotonic() if job.began is None else job.began

    def abandon(self, thread: int, why: Exception) -> bool:
        """Leave the render thread alone if it hangs in a thread's job; another one does the rest.

        Args:
            thread: the one that waits for the job's result, or the render thread itself.
            why: what is raised in the thread that waits.

        Returns:
            Whether it was so.
        """
        with self._lock:
            job = self._running
            hanging = self._thread.ident if self._thread else None
            if job is None or hanging is None or thread not in (job.caller, hanging):
                return False
            if not self._in_progress.abandon(job):
                return False
            job.future.set_exception(why)
            self._running = None
            # Before anything that waits: the thread could end then, and another get its identity.
            interrupt(hanging)
            self._in_progress.answered(job)
            self._start()
            return True

    def abandon_if_began_before(self, moment: float, why: Exception) -> bool:
        """Leave the render thread alone if its job takes too long; another one does the rest.

        Args:
            moment: a job that began before it takes too long, in the clock's seconds.
            why: what is raised in the thread that waits for the result.

        Returns:
            Whether it was so.
        """
        job = self._running
        if job is None or job.began is None or job.began >= moment:
            return False
        return self.abandon(job.caller, why)

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
