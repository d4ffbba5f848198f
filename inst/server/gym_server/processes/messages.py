"""Calls from the server to a process that it started, and their results.

The server sends calls as pickles, because the process can trust the server. The server cannot trust
the process of an isolated environment, which the environment may have taken over. So results are
numbers, JSON and bytes, checked before use, and none of them names code. Only a process that runs
what would otherwise run in the server's own process may return Python objects.
"""

from __future__ import annotations

import json
import math
import pickle
import struct
import threading
import time
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

import numpy as np

from gym_server.errors import GymServerError
from gym_server.processes.pipe import MalformedMessageError, Pipe
from gym_server.protocol.answers import Ready, dumps
from gym_server.protocol.safetensors import COLUMN_TENSORS, TENSORS
from gym_server.response import JSON

# The number of the call, the kind of the result, and the length of its text. A finished body has no
# text, but the number of steps that it took.
_HEAD = struct.Struct("<QBI")

_REFUSAL, _VALUE, _JSON, _TENSORS, _OBJECT, _COLUMN_TENSORS = range(6)

_CONTENT_TYPES = {_JSON: JSON, _TENSORS: TENSORS, _COLUMN_TENSORS: COLUMN_TENSORS}
_KINDS = {content_type: kind for kind, content_type in _CONTENT_TYPES.items()}

_LONGEST_TEXT = 100_000


class Result(NamedTuple):
    """The result of a function: a JSON value, and a frame or None."""

    value: Any
    frame: np.ndarray | None = None


# The process's side -------------------------------------------------------------------------


def read_call(raw: bytes) -> tuple[int, str, tuple]:
    """Return a call's number, the function's name, and its arguments."""
    number, method, args = pickle.loads(raw)
    return number, method, args


def answer_message(number: int, answer: Ready) -> bytes:
    """Return the message for a finished body."""
    return _HEAD.pack(number, _KINDS[answer.content_type], answer.steps) + answer.body


def value_message(number: int, value: object, frame: np.ndarray | None = None) -> bytes:
    """Return the message for a JSON value and a frame."""
    text = dumps([value, None if frame is None else frame.shape])
    pixels = b"" if frame is None else frame.tobytes()
    return _HEAD.pack(number, _VALUE, len(text)) + text + pixels


def object_message(number: int, value: object) -> bytes:
    """Return the message for any Python object, from a trusted process."""
    return _HEAD.pack(number, _OBJECT, 0) + pickle.dumps(value, 5)


def refusal_message(number: int, refusal: dict[str, str]) -> bytes:
    """Return the message for an error; see ``errors.answer_to()``."""
    text = dumps(refusal)
    return _HEAD.pack(number, _REFUSAL, len(text)) + text


# The server's side --------------------------------------------------------------------------


class CallPipe:
    """Calls functions in the process, one at a time.

    Attributes:
        busy_since: when the current call started, in the clock's seconds; None if there is none.
    """

    def __init__(self, connection: Connection, trusted: bool = False) -> None:
        """Take over the server's end of a pipe.

        Args:
            connection: the server's end.
            trusted: whether the process may return any Python object.
        """
        self._pipe = Pipe(connection)
        self._trusted = trusted
        self._lock = threading.Lock()
        self._number = 0
        self.busy_since: float | None = None

    def call(self, method: str, *args: object, timeout: float | None = None) -> Any:
        """Call a function in the process.

        Args:
            method: its name.
            *args: its arguments; they are pickled.
            timeout: seconds to wait; None to wait without limit.

        Returns:
            ``Ready``, ``Result``, or from a trusted process any other object.

        Raises:
            GymServerError: the function's error, or ``malformed_json``.
            EOFError, OSError: the process has ended.
            TimeoutError: it took too long; its result will be ignored.
            MalformedMessageError: the process did not send a valid result.
        """
        self.begin(method, *args, timeout=timeout)
        return self.finish(timeout)

    def begin(self, method: str, *args: object, timeout: float | None = None) -> None:
        """Send a call; ``finish()`` must follow unless this raises an error.

        Args:
            method: the name of the function.
            *args: its arguments; they are pickled.
            timeout: seconds to wait for an earlier call.

        Raises:
            GymServerError, EOFError, OSError, TimeoutError: as for ``call()``.
        """
        if not self._lock.acquire(timeout=-1 if timeout is None else timeout):
            raise TimeoutError
        self.busy_since = time.monotonic()
        try:
            self._number += 1
            self._pipe.send(_pickled(self._number, method, args))
        except BaseException:
            self._end()
            raise

    def finish(self, timeout: float | None = None) -> Any:
        """Wait for the result of the call; see ``call()``."""
        try:
            return self._receive(timeout)
        finally:
            self._end()

    def _end(self) -> None:
        self.busy_since = None
        self._lock.release()

    def _receive(self, timeout: float | None) -> Any:
        while True:
            if timeout is not None and not self._pipe.poll(timeout):
                raise TimeoutError
            raw = self._pipe.receive()
            number = _HEAD.unpack_from(raw)[0] if len(raw) >= _HEAD.size else -1
            if number == self._number:
                return _read_result(raw, self._trusted)
            # A smaller number belongs to a call that timed out.
            if not 0 < number < self._number:
                raise MalformedMessageError("an answer to no call")

    def wake(self) -> None:
        """Make a call in another thread fail, because the process has ended."""
        self._pipe.wake()

    def close(self) -> None:
        """Close the pipe when no call is waiting any more; ``wake()`` ends one that is."""
        with self._lock:
            self._pipe.close()


def _pickled(number: int, method: str, args: tuple) -> bytes:
    try:
        return pickle.dumps((number, method, args), 5)
    except RecursionError:
        # The JSON reader allows deeper nesting than pickle.
        raise GymServerError(
            "malformed_json",
            "The lists in the request's body are nested too deeply",
        ) from None


def _read_result(raw: bytes, trusted: bool) -> Any:
    _, kind, length = _HEAD.unpack_from(raw)
    if kind == _OBJECT and trusted:
        return pickle.loads(memoryview(raw)[_HEAD.size :])
    if kind in _CONTENT_TYPES:
        return Ready(raw[_HEAD.size :], _CONTENT_TYPES[kind], length)
    end = _HEAD.size + length
    if end > len(raw):
        raise MalformedMessageError("a truncated text")
    try:
        value = json.loads(raw[_HEAD.size : end])
    except (ValueError, RecursionError):
        raise MalformedMessageError("a text that is not JSON") from None
    if kind == _REFUSAL:
        raise _refusal(value)
    if kind != _VALUE or not isinstance(value, list) or len(value) != 2:
        raise MalformedMessageError("an answer of an unknown kind")
    return Result(value[0], _frame(value[1], raw, end))


def _refusal(value: object) -> Exception:
    if not isinstance(value, dict):
        return MalformedMessageError("an invalid error")
    parts: list[Any] = [value.get(name) for name in ("code", "message", "hint", "extra")]
    if not all(part is None or isinstance(part, str) for part in parts):
        return MalformedMessageError("an invalid error")
    code, message, *_ = parts
    if not code or not code.isidentifier() or message is None:
        return MalformedMessageError("an error without a name")
    refusal = GymServerError(*(part and part[:_LONGEST_TEXT] for part in parts))
    refusal.is_logged = True
    return refusal


def _frame(shape: object, raw: bytes, begin: int) -> np.ndarray | None:
    if shape is None:
        return None
    if (
        not isinstance(shape, list)
        or not all(type(n) is int and n > 0 for n in shape)
        or len(shape) != 3
        or shape[2] not in (1, 3, 4)
    ):
        raise MalformedMessageError("a picture without a shape")
    if math.prod(shape) != len(raw) - begin:
        raise MalformedMessageError("a picture whose size does not match its shape")
    return np.frombuffer(raw, np.uint8, offset=begin).reshape(shape)
