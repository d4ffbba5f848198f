"""A process that the server started: calls to it, and how it ended.

It runs what would otherwise run in the server's own process.
"""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import threading
import time
from collections.abc import Callable
from multiprocessing import process as multiprocessing_process
from multiprocessing.connection import wait
from typing import Any, cast

from gym_server import memory
from gym_server.errors import GymServerError, call_too_long, environment_died, shutting_down
from gym_server.processes import start
from gym_server.processes.messages import CallPipe
from gym_server.processes.serve import serve
from gym_server.threads.calls import waiting

log = logging.getLogger(__name__)

# How long a process may take to exit after its pipe is closed.
_EXIT_SECONDS = 2.0

# The exit status arrives shortly after the pipe is closed, and later on a busy machine.
_EXIT_STATUS_SECONDS = 10.0

# A ``nice`` value. A process cannot undo it.
_LOWER_PRIORITY = 5

# The errors of a call when the process has ended.
_FAULTS = (EOFError, OSError, ValueError)


# All that have not ended.
_alive: set[WorkerProcess] = set()


def kill_overdue(seconds: float) -> None:
    """End the processes whose call has made no progress for this many seconds."""
    for process in list(_alive):
        process.kill_if_overdue(seconds)


class WorkerProcess:
    """A process that runs the functions of one module.

    Attributes:
        module: the name of the module.
        pid: the process number.
        why: the error for every caller once it has ended, else None.
        progress: two integers that the running function may set; while it changes the first, it
            does not hang.
    """

    def __init__(self, module: str, low_priority: bool = False) -> None:
        """Start the process.

        Args:
            module: the name of the module.
            low_priority: whether it runs at a lower priority than other processes, including the
                server.
        """
        self.module = module
        self.why: GymServerError | None = None
        self._on_end: Callable[[GymServerError], None] = lambda why: None
        self._lock = threading.Lock()
        # Why the server ended it, if it did: by intention, or because a call hung.
        self._our_reason: GymServerError | None = None
        self._hung: GymServerError | None = None
        # How it ended, if it did not exit.
        self._fault = ""
        self._phase = "while it was created"
        # Until report_end(), the creation that waits for the process gets the error itself.
        self._end_expected = True
        self._ended = threading.Event()
        # Since when the current call has made no progress, in the clock's seconds; None if no call
        # is running.
        self._since: float | None = None
        self._last_progress = 0
        context = start.context()
        self.progress = context.RawArray("q", 2)
        ours, theirs = context.Pipe()
        self._calls = CallPipe(ours)
        # Not a daemon: daemons may not start processes, and sub-environments can be processes.
        self._process = context.Process(
            target=serve,
            args=(theirs, self.progress),
            daemon=False,
        )
        try:
            self._process.start()
            self.pid = cast(int, self._process.pid)
            with memory.for_threads():
                threading.Thread(target=self._await_end, daemon=True).start()
            _alive.add(self)
        except BaseException:
            self._send_kill()
            self._calls.close()
            raise
        finally:
            theirs.close()
        if low_priority and hasattr(os, "setpriority"):
            with contextlib.suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, self.pid, _LOWER_PRIORITY)
        # When multiprocessing starts a process it polls all on this list, and at exit it waits for
        # all of them. Only our own thread may wait for this one.
        # The type is ignored because the list is private.
        multiprocessing_process._children.discard(self._process)  # type: ignore[attr-defined]

    @property
    def is_alive(self) -> bool:
        """Whether it is running."""
        return self.why is None

    # Calls ----------------------------------------------------------------------------------

    def call(self, function: str, *args: object) -> Any:
        """Call a function of its module; the caller ensures that only one call runs.

        Returns:
            The function's result.

        Raises:
            GymServerError: the function's error, ``environment_died``, or why the process was
                killed.
        """
        self.begin(function, *args)
        return self.finish()

    def begin(self, function: str, *args: object) -> None:
        """Start a ``call()``; unless this raises an error, ``finish()`` must follow."""
        if self.why is not None:
            raise self.why.again()
        self._since = time.monotonic()
        try:
            with waiting():
                self._calls.begin(f"{self.module}:{function}", *args)
        except _FAULTS:
            raise self._ended_by() from None
        except BaseException:
            self._since = None
            raise

    def finish(self) -> Any:
        """Return the result of the call; see ``call()``."""
        try:
            with waiting():
                return self._calls.finish()
        except _FAULTS:
            raise self._ended_by() from None
        except MemoryError:
            # The rest of the result is still in the pipe.
            self._fault = "the server has no memory for its result (--max-memory-mb)"
            self._send_kill()
            raise self._ended_by() from None
        finally:
            self._since = None

    def _ended_by(self) -> GymServerError:
        """Make sure that the process has ended; return the reason."""
        if not self._ended.wait(_EXIT_STATUS_SECONDS):
            self._fault = "it closed its connection to the server"
            self._send_kill()
        self._ended.wait(_EXIT_SECONDS)
        # A process that even the system cannot end has no exit status.
        return self.why.again() if self.why else self._died(None)

    # The end --------------------------------------------------------------------------------

    def report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        """Report an unexpected end from now on, or at once if it has ended.

        The reason is reported in a separate thread. If the process ends during this call, the lock
        leaves two possible orders, and ``on_end`` is called once in both:

        1. ``_await_end()`` sets ``why`` first, and reports nothing because it expects the end.
           Then this finds ``why`` and calls ``on_end``.
        2. This clears ``_end_expected`` first and finds no ``why``. Then ``_await_end()`` calls
           ``on_end``.
        """
        with self._lock:
            self._on_end = on_end
            self._phase = "by itself"
            self._end_expected = False
            why = self.why
        if why is not None:
            on_end(why)

    def release(self) -> None:
        """Stop reporting an unexpected end."""
        self._end_expected = True

    def kill(self, why: GymServerError | None = None) -> None:
        """End it at once; every waiting call raises the reason."""
        with self._lock:
            self._our_reason = self._our_reason or why or shutting_down()
        self._send_kill()

    def kill_if_overdue(self, seconds: float) -> None:
        """End it if its call has made no progress for this many seconds."""
        since, progress, now = self._since, self.progress[0], time.monotonic()
        if since is None:
            return
        if progress != self._last_progress:
            self._last_progress, self._since = progress, now
        elif now > since + seconds:
            self._hung = call_too_long(seconds)
            self._send_kill()

    def _send_kill(self) -> None:
        if not self._ended.is_set():
            with contextlib.suppress(OSError, ValueError, AttributeError):
                self._process.kill()

    def _await_end(self) -> None:
        wait([self._process.sentinel])
        self._process.join()
        code = self._process.exitcode
        self._kill_group()
        with self._lock:
            self.why = self._our_reason or self._hung or self._died(code)
            was_expected = self._end_expected or self._our_reason is not None
        self._ended.set()
        _alive.discard(self)
        self._calls.wake()
        self._calls.close()
        self._process.close()
        if not was_expected:
            log.warning("Process %d: %s", self.pid, self.why.message)
            self._on_end(self.why)

    def _kill_group(self) -> None:
        """Kill the processes that it started."""
        if hasattr(os, "killpg"):
            with contextlib.suppress(OSError):
                os.killpg(self.pid, signal.SIGKILL)

    def _died(self, code: int | None) -> GymServerError:
        return environment_died(self._fault or _how(code), self._phase)


def _how(code: int | None) -> str:
    if code is None or code >= 0:
        return f"exit status {code}"
    try:
        return f"signal {signal.Signals(-code).name}"
    except ValueError:
        return f"signal {-code}"
