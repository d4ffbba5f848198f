"""A process that the server has started, what it is asked, and how it ended."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import threading
from collections.abc import Callable
from multiprocessing import process as multiprocessing_process
from multiprocessing.connection import wait

from gym_server.errors import GymServerError, environment_died
from gym_server.processes import start
from gym_server.processes.messages import Channel, Seen
from gym_server.processes.pipe import Nonsense
from gym_server.protocol.answers import Ready

log = logging.getLogger(__name__)

# Once its end of the pipe is closed it has nothing to do any more.
_LEAVES_SECONDS = 2.0

# How it ended is known a little later than that it did, on a busy machine more than a little.
_NEWS_SECONDS = 10.0

# What a process that is gone, or no longer what it was, is known by.
_FAULTS = (EOFError, OSError, ValueError, Nonsense)


class WorkerProcess:
    """A process with a channel for moves and one for what can be asked meanwhile.

    Attributes:
        pid: its number.
        why: the reason that everybody gets once it has ended, else None.
    """

    def __init__(
        self, target: Callable, *args: object, on_end: Callable[[GymServerError], None], hint: str
    ) -> None:
        """Start it.

        Args:
            target: what runs there; gets its ends of the channels, then the arguments.
            *args: the arguments.
            on_end: called with the reason, in a thread of its own, once it has ended in a way
                that was not asked for.
            hint: what to do about such an end, or "".
        """
        self._on_end = on_end
        self._hint = hint or None
        self._lock = threading.Lock()
        self._condemned: GymServerError | None = None
        self._nonsense = ""
        self._doing = "while it was created"
        # Who waits for what it makes hears of an end at once.
        self._expected = True
        self._ended = threading.Event()
        self.why: GymServerError | None = None
        context = start.context()
        pipes = [context.Pipe() for _ in range(2)]
        self._moves, self._questions = (Channel(ours) for ours, _ in pipes)
        # Not a daemon: those may start no processes, as sub-environments are.
        self._process = context.Process(
            target=target, args=(*(theirs for _, theirs in pipes), *args), daemon=False
        )
        try:
            self._process.start()
            self.pid = self._process.pid
            threading.Thread(target=self._await_end, daemon=True).start()
        except BaseException:
            self._kill()
            for channel in (self._moves, self._questions):
                channel.close()
            raise
        finally:
            for _, theirs in pipes:
                theirs.close()
        # Else whoever starts another one would ask after this one's end, too, and the server's
        # end would wait for it.
        multiprocessing_process._children.discard(self._process)  # type: ignore[attr-defined]

    def first_word(self) -> Seen:
        """Wait for what it says unasked; see ``move()``."""
        try:
            return self._moves.hear()
        except _FAULTS as fault:
            raise self._end_after(fault) from None

    def stay(self) -> None:
        """Take no end of it for what was asked for: none from now on, and none that has come."""
        with self._lock:
            self._doing = "by itself"
            self._expected = False
            ended = self.why
        if ended is not None:
            self._on_end(ended)

    def move(self, method: str, *args: object) -> Ready | Seen:
        """Ask for a move or a look; one at a time.

        Raises:
            GymServerError: what it refused with, or why it has ended.
        """
        if self.why is not None:
            raise self.why.again()
        try:
            return self._moves.ask(method, *args)
        except _FAULTS as fault:
            raise self._end_after(fault) from None

    def question(self, method: str, *args: object, seconds: float | None = None) -> Seen:
        """Ask what can be said while it moves.

        Raises:
            GymServerError: as for ``move()``.
            TimeoutError: it took more than these seconds.
        """
        if self.why is not None:
            raise self.why.again()
        try:
            return self._questions.ask(method, *args, seconds=seconds)
        except TimeoutError:
            raise
        except _FAULTS as fault:
            raise self._end_after(fault) from None

    @property
    def questioned_since(self) -> float | None:
        """Since when it owes an answer to a ``question()``, in the clock's seconds, or None."""
        return self._questions.busy_since

    def _end_after(self, fault: Exception) -> GymServerError:
        """Return why a process that is of no use has ended, after seeing to that."""
        if isinstance(fault, Nonsense):
            self._nonsense = f"it sent {fault}"
            self._kill()
        elif not self._ended.wait(_NEWS_SECONDS):
            self._nonsense = "it closed its connection to the server"
            self._kill()
        self._ended.wait(_LEAVES_SECONDS)
        # None of one that the system itself cannot end.
        return self.why.again() if self.why else self._died(None)

    def condemn(self, why: GymServerError) -> None:
        """End it at once; whoever waits for it gets the reason."""
        with self._lock:
            self._condemned = self._condemned or why
        self._kill()

    def let_go(self, why: GymServerError) -> None:
        """Wait for its end, which was asked for, and end it when it does not come."""
        with self._lock:
            self._condemned = self._condemned or why
            self._expected = True
        if not self._ended.wait(_LEAVES_SECONDS):
            self._kill()

    def expect_end(self) -> None:
        """Take its end from now on for what was asked for."""
        self._expected = True

    def _kill(self) -> None:
        if not self._ended.is_set():
            with contextlib.suppress(OSError, ValueError, AttributeError):
                self._process.kill()

    def _await_end(self) -> None:
        wait([self._process.sentinel])
        self._process.join()
        code = self._process.exitcode
        self._kill_group()
        with self._lock:
            self.why = self._condemned or self._died(code)
            told = self._expected or self._condemned is not None
        self._ended.set()
        for channel in (self._moves, self._questions):
            channel.wake()
            channel.close()
        self._process.close()
        if not told:
            log.warning("Process %d: %s", self.pid, self.why.message)
            self._on_end(self.why)

    def _kill_group(self) -> None:
        """End what the process has started."""
        if hasattr(os, "killpg"):
            with contextlib.suppress(OSError):
                os.killpg(self.pid, signal.SIGKILL)

    def _died(self, code: int | None) -> GymServerError:
        return environment_died(self._nonsense or _how(code), self._doing, self._hint)


def _how(code: int | None) -> str:
    if code is None or code >= 0:
        return f"exit status {code}"
    try:
        return f"signal {signal.Signals(-code).name}"
    except ValueError:
        return f"signal {-code}"
