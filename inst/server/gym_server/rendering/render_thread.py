"""The one thread that draws.

There is one pygame per process: an environment's ``close()`` calls ``pygame.quit()``, which removes
the fonts of all other environments. An OpenGL context belongs to the thread that created it. So all
drawing, and closing of what was drawn, runs here, and pygame ends with the process.
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


# How often a thread that waits for its turn asks whether to keep waiting.
_POLL_SECONDS = 0.02


class Occupied(Exception):  # noqa: N818
    """The render thread is busy with other work."""


class _Job:
    """One piece of work for the render thread.

    Attributes:
        caller: the thread that waits for the result.
        draw: the function to run.
        future: its result.
        began: when it started, in the clock's seconds; None while it waits for its turn.
    """

    def __init__(self, draw: Callable[[], object]) -> None:
        self.caller = threading.get_ident()
        self.draw = draw
        self.future: Future = Future()
        self.began: float | None = None


class RenderThread:
    """Runs drawing and closing functions one after another."""

    def __init__(self) -> None:
        """Start no thread yet: a server that never draws needs none."""
        self._lock = threading.Lock()
        self._queue: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        self._running: _Job | None = None
        self._in_progress: InProgress[_Job, None] = InProgress()
        self._stopped = False
        # By the thread that waits for the result.
        self._jobs: dict[int, _Job] = {}

    def run(self, draw: Callable[..., ResultT], *args: object) -> ResultT:
        """Run a function on the render thread; return its result or raise its exception."""
        if threading.current_thread() is self._thread:
            # Drawing may call for drawing, for example in a monitored environment.
            return draw(*args)
        with self._job(draw, *args) as job:
            result: ResultT = job.future.result()
            return result

    def close(self, close: Callable[[], object], drawn: bool) -> None:
        """Close an environment: on the render thread if it has drawn, else in this thread."""
        if drawn:
            self.run(close)
        else:
            _keep_pygame_and(close)

    def run_while(
        self, may_wait: Callable[[], bool], draw: Callable[..., ResultT], *args: object
    ) -> ResultT:
        """Run a function on the render thread, unless its turn takes too long to come.

        Args:
            may_wait: returns whether to keep waiting; called every 20 ms until the function starts.
            draw: the function.
            *args: its arguments.

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
        # A daemon thread, so that drawing that never ends does not keep the process alive.
        self._thread = threading.Thread(target=self._work, name="render", daemon=True)
        self._thread.start()

    def _work(self) -> None:
        while (job := self._queue.get()) is not None:
            self._running = job
            if not self._do(job):
                return
            # Do not keep the picture until the next job comes.
            self._running = job = None

    def _do(self, job: _Job) -> bool:
        """Run a job; return False if another thread has replaced this one meanwhile."""
        job.began = time.monotonic()
        if not job.future.set_running_or_notify_cancel():
            return True
        self._in_progress[job] = None
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
        """Return when the job that a thread waits for started, in the clock's seconds.

        None if the thread does not wait for a job, the current time if the job has not started.
        """
        job = self._jobs.get(thread)
        if job is None:
            return None
        return time.monotonic() if job.began is None else job.began

    def abandon(self, thread: int, why: Exception) -> bool:
        """Replace the render thread if it is stuck in a thread's job.

        Args:
            thread: the thread that waits for the job's result, or the render thread itself.
            why: the exception to raise in the waiting thread.

        Returns:
            Whether the render thread was stuck there and was replaced.
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
            # Interrupt before waiting: the thread could end, and another get its identity.
            interrupt(hanging)
            self._in_progress.answered(job)
            self._start()
            return True

    def abandon_if_began_before(self, moment: float, why: Exception) -> bool:
        """Replace the render thread if its job takes too long.

        Args:
            moment: the latest allowed start of the job, in the clock's seconds.
            why: the exception to raise in the thread that waits for the result.

        Returns:
            Whether the render thread was replaced.
        """
        job = self._running
        if job is None or job.began is None or job.began >= moment:
            return False
        return self.abandon(job.caller, why)

    def stop(self) -> None:
        """Finish the queued jobs, and end the thread."""
        with self._lock:
            self._stopped = True
            self._queue.put(None)
        if self._thread is not None:
            self._thread.join()


def _keep_pygame_and(draw: Callable[..., ResultT], *args: object) -> ResultT:
    # Environments import pygame when they first draw and quit it when they close. Checking before
    # each job is early enough, and a server that never draws never pays for the import.
    if "pygame" in sys.modules:
        import pygame

        pygame.quit = pygame.display.quit = _quit_later
    return draw(*args)


def _quit_later() -> None:
    """Replace pygame's quit functions; pygame runs its own at the end of the process."""
