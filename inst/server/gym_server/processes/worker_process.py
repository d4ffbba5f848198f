"""A process that the server has started: calls to it, and how it ended."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import threading
from collections.abc import Callable
from multiprocessing import process as multiprocessing_process
from multiprocessing.connection import wait
from typing import Any, cast

from gym_server.errors import GymServerError, environment_died
from gym_server.processes import start
from gym_server.processes.messages import CallPipe, Result
from gym_server.processes.pipe import MalformedMessageError

log = logging.getLogger(__name__)

# After its end of the pipe is closed the process has nothing left to do.
_EXIT_SECONDS = 2.0

# The exit status comes a little after the pipe is closed, and on a busy machine later.
_EXIT_STATUS_SECONDS = 10.0

# What a call raises when the process is gone, or was taken over.
_FAULTS = (EOFError, OSError, ValueError, MalformedMessageError)


class WorkerProcess:
    """A process with one pipe for calls in turn, and one for queries that it answers meanwhile.

    Attributes:
        pid: its number.
        why: the reason that every caller gets once it has ended, else None.
    """

    def __init__(
        self,
        target: Callable,
        *args: object,
        on_end: Callable[[GymServerError], None],
        hint: str,
        trusted: bool = False,
        first_result: bool = False,
    ) -> None:
        """Start it.

        Args:
            target: what runs there; gets its ends of the two pipes, then the arguments.
            *args: the arguments.
            on_end: called with the reason, in a thread of its own, once the process has ended
                without having been asked to; see ``report_end()``.
            hint: what to do about such an end, or "".
            trusted: whether its results may be any objects of Python's; see ``messages``.
            first_result: whether it sends a result without a call; see ``first_result()``.
        """
        self._on_end = on_end
        self._hint = hint or None
        self._lock = threading.Lock()
        # Why we ended it, if we did.
        self._our_reason: GymServerError | None = None
        # What was wrong with what it sent.
        self._fault = ""
        self._phase = "while it was created"
        # Until report_end(): the creation that waits for it gets the error itself.
        self._end_expected = True
        self._ended = threading.Event()
        self.why: GymServerError | None = None
        context = start.context()
        pipes = [context.Pipe() for _ in range(2)]
        self._calls = CallPipe(pipes[0][0], trusted, first_result)
        self._queries = CallPipe(pipes[1][0], trusted)
        # Not a daemon: a daemon may start no processes, and sub-environments can be processes.
        self._process = context.Process(
            target=target, args=(*(theirs for _, theirs in pipes), *args), daemon=False
        )
        try:
            self._process.start()
            self.pid = cast(int, self._process.pid)
            threading.Thread(target=self._await_end, daemon=True).start()
        except BaseException:
            self._send_kill()
            for pipe in (self._calls, self._queries):
                pipe.close()
            raise
        finally:
            for _, theirs in pipes:
                theirs.close()
        # multiprocessing asks every process on this list whether it has ended when it starts
        # another one, and waits for all of them at exit. Only our own thread may wait for this one.
        # The type ignored: the list is private.
        multiprocessing_process._children.discard(self._process)  # type: ignore[attr-defined]

    def first_result(self) -> Result:
        """Wait for the result that it sends without a call.

        Raises:
            GymServerError: as for ``call()``.
        """
        try:
            return cast(Result, self._calls.first_result())
        except _FAULTS as fault:
            raise self._end_after(fault) from None

    def report_end(self) -> None:
        """From now on call ``on_end`` when it ends without being asked to, or if it has already.

        It may end while this is called. The lock leaves two orders, and ``on_end`` is called once:

        1. ``_await_end()`` sets ``why`` first and sees an expected end, of which it tells no one;
           then this finds ``why`` and calls ``on_end``.
        2. This clears ``_end_expected`` first and finds no ``why``; then ``_await_end()`` calls
           ``on_end``.
        """
        with self._lock:
            self._phase = "by itself"
            self._end_expected = False
            why = self.why
        if why is not None:
            self._on_end(why)

    def call(self, method: str, *args: object) -> Any:
        """Call a method there; the caller sees to it that only one call runs at a time.

        Returns:
            ``Ready`` for a method that returns an ``Answer``, else ``Result``.

        Raises:
            GymServerError: what it refused with, or why it has ended.
        """
        self.begin(method, *args)
        return self.finish()

    def begin(self, method: str, *args: object) -> None:
        """Begin a ``call()``; unless this raises an error, ``finish()`` must follow."""
        if self.why is not None:
            raise self.why.again()
        try:
            self._calls.begin(method, *args)
        except _FAULTS as fault:
            raise self._end_after(fault) from None

    def finish(self) -> Any:
        """Return the result of the call that has begun; see ``call()``."""
        try:
            return self._calls.finish()
        except _FAULTS as fault:
            raise self._end_after(fault) from None

    def query(self, method: str, *args: object, timeout: float | None = None) -> Result:
        """Call a method that it answers even while a ``call()`` runs.

        Raises:
            GymServerError: as for ``call()``.
            TimeoutError: it took more than these seconds.
        """
        if self.why is not None:
            raise self.why.again()
        try:
            return cast(Result, self._queries.call(method, *args, timeout=timeout))
        except TimeoutError:
            raise
        except _FAULTS as fault:
            raise self._end_after(fault) from None

    @property
    def query_since(self) -> float | None:
        """Since when a ``query()`` has waited for its result, in the clock's seconds, or None."""
        return self._queries.busy_since

    def _end_after(self, fault: Exception) -> GymServerError:
        """Return why the process has ended, after making sure that it has."""
        if isinstance(fault, MalformedMessageError):
            self._fault = f"it sent {fault}"
            self._send_kill()
        elif not self._ended.wait(_EXIT_STATUS_SECONDS):
            self._fault = "it closed its connection to the server"
            self._send_kill()
        self._ended.wait(_EXIT_SECONDS)
        # There is no exit status of a process that even the system cannot end.
        return self.why.again() if self.why else self._died(None)

    def kill(self, why: GymServerError) -> None:
        """End it at once; every call that waits for it raises the reason."""
        with self._lock:
            self._our_reason = self._our_reason or why
        self._calls.drop_first_result()
        self._send_kill()

    def begin_close(self) -> None:
        """Take its end from now on for one that was asked for."""
        self._end_expected = True

    def close(self, why: GymServerError) -> None:
        """Wait until it has exited as it was asked to, and kill it when it does not."""
        with self._lock:
            self._our_reason = self._our_reason or why
            self._end_expected = True
        if not self._ended.wait(_EXIT_SECONDS):
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
            self.why = self._our_reason or self._died(code)
            was_expected = self._end_expected or self._our_reason is not None
        self._ended.set()
        for pipe in (self._calls, self._queries):
            pipe.wake()
            pipe.close()
        self._process.close()
        if not was_expected:
            log.warning("Process %d: %s", self.pid, self.why.message)
            self._on_end(self.why)

    def _kill_group(self) -> None:
        """Kill what the process has started."""
        if hasattr(os, "killpg"):
            with contextlib.suppress(OSError):
                os.killpg(self.pid, signal.SIGKILL)

    def _died(self, code: int | None) -> GymServerError:
        return environment_died(self._fault or _how(code), self._phase, self._hint)


def _how(code: int | None) -> str:
    if code is None or code >= 0:
        return f"exit status {code}"
    try:
        return f"signal {signal.Signals(-code).name}"
    except ValueError:
        return f"signal {-code}"
