"""Calls from the server to a process that it started, and their results, both as pickles."""

from __future__ import annotations

import pickle
import threading
from multiprocessing.connection import Connection
from typing import Any

from gym_server.errors import GymServerError, environment_error
from gym_server.processes.pipe import Pipe


def result_message(result: object, error: GymServerError | None = None) -> bytes:
    """Return the message for a result, or for the error instead of it."""
    return pickle.dumps((result, error), 5)


class CallPipe:
    """Calls functions in the process, one at a time."""

    def __init__(self, connection: Connection) -> None:
        """Take over the server's end of a pipe."""
        self._pipe = Pipe(connection)
        self._lock = threading.Lock()

    def begin(self, method: str, *args: object) -> None:
        """Send a call; ``finish()`` must follow unless this raises an error.

        Args:
            method: the name of the function.
            *args: its arguments; they are pickled.

        Raises:
            GymServerError: ``malformed_json``.
            EOFError, OSError: the process has ended.
        """
        try:
            message = pickle.dumps((method, args), 5)
        except RecursionError:
            # The JSON reader allows deeper nesting than pickle.
            raise GymServerError(
                "malformed_json", "The lists in the request's body are nested too deeply"
            ) from None
        self._lock.acquire()
        try:
            self._pipe.send(message)
        except BaseException:
            self._lock.release()
            raise

    def finish(self) -> Any:
        """Wait for the result of the call.

        Raises:
            GymServerError: the function's error, or that its result cannot be read here.
            EOFError, OSError: the process has ended.
        """
        try:
            raw = self._pipe.receive()
        finally:
            self._lock.release()
        try:
            result, error = pickle.loads(raw)
        except Exception as fault:
            raise environment_error(fault, "Reading what the environment returned") from fault
        if error is not None:
            raise error
        return result

    def wake(self) -> None:
        """Make a call in another thread fail, because the process has ended."""
        self._pipe.wake()

    def close(self) -> None:
        """Close the pipe when no call is waiting any more; ``wake()`` ends one that is."""
        with self._lock:
            self._pipe.close()
