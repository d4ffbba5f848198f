"""Method calls from the server to a process that it has started, and their results.

The server sends calls as pickles: the process can trust the server.  The server cannot trust the
process of an isolated environment, which the environment may have taken over.  So its results are
numbers, JSON and bytes, each checked before it is used, and nothing in them names code.  Only a
process that runs what would otherwise run in the server's own process may return Python's objects.
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

# The number of the call, the kind of the result, and the length of its text; of an answer, which
# has none, how many steps were taken for it.
_HEAD = struct.Struct("<QBI")

_REFUSAL, _VALUE, _JSON, _TENSORS, _OBJECT, _COLUMN_TENSORS = range(6)

_CONTENT_TYPES = {_JSON: JSON, _TENSORS: TENSORS, _COLUMN_TENSORS: COLUMN_TENSORS}
_KINDS = {content_type: kind for kind, content_type in _CONTENT_TYPES.items()}

_LONGEST_TEXT = 100_000


class Result(NamedTuple):
    """What a method returned: a JSON value, and a frame or None."""

    value: Any
    frame: np.ndarray | None = None


# The process's side -------------------------------------------------------------------------


def read_call(raw: bytes) -> tuple[int, str, tuple]:
    """Return a call's number, the name of the method, and its arguments."""
    number, method, args = pickle.loads(raw)
    return number, method, args


def answer_message(number: int, answer: Ready) -> bytes:
    """Return the message that carries an answer that is ready."""
    return _HEAD.pack(number, _KINDS[answer.content_type], answer.steps) + answer.body


def value_message(number: int, value: object, frame: np.ndarray | None = None) -> bytes:
    """Return the message that carries a JSON value and a frame."""
    text = dumps([value, None if frame is None else frame.shape])
    pixels = b"" if frame is None else frame.tobytes()
    return _HEAD.pack(number, _VALUE, len(text)) + text + pixels


def object_message(number: int, value: object) -> bytes:
    """Return the message that carries any object of Python's from a process that is trusted."""
    return _HEAD.pack(number, _OBJECT, 0) + pickle.dumps(value, 5)


def refusal_message(number: int, refusal: dict[str, str]) -> bytes:
    """Return the message that carries an error; see ``errors.answer_to()``."""
    text = dumps(refusal)
    return _HEAD.pack(number, _REFUSAL, len(text)) + text


# The server's side --------------------------------------------------------------------------


class CallPipe:
    """Calls methods in the process, one at a time.

    Attributes:
        busy_since: since when a call has waited for its result, in the clock's seconds; None
            while there is none.
    """

    def __init__(self, connection: Connection, trusted: bool = False) -> None:
        """Take over the server's end of a pipe.

        Args:
            connection: the end.
            trusted: whether the process may return any object of Python's.
        """
        self._pipe = Pipe(connection)
        self._trusted = trusted
        self._lock = threading.Lock()
        self._number = 0
        self.busy_since: float | None = None

    def call(self, method: str, *args: object, timeout: float | None = None) -> Any:
        """Call a method in the process.

        Args:
            method: its name.
            *args: its arguments; they are pickled.
            timeout: how many seconds to wait; None for as long as it takes.

        Returns:
            ``Ready``, ``Result``, or from a process that is trusted any other object.

        Raises:
            GymServerError: what the process refused with; ``malformed_json``.
            EOFError, OSError: the process is gone.
            TimeoutError: it took too long; its result will be ignored.
            MalformedMessageError: what it sent is no result.
        """
        self.begin(method, *args, timeout=timeout)
        return self.finish(timeout)

    def begin(self, method: str, *args: object, timeout: float | None = None) -> None:
        """Send a call; ``finish()`` must follow unless this raises an error.

        Args:
            method: its name.
            *args: its arguments; they are pickled.
            timeout: how many seconds to wait for an earlier call.

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
        """Wait for the result of the call that has begun; see ``call()``."""
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
            # A smaller number is that of a call that was not waited for any more.
            if not 0 < number < self._number:
                raise MalformedMessageError("an answer that nobody asked for")

    def wake(self) -> None:
        """Make a call in another thread fail, because the process is gone."""
        self._pipe.wake()

    def close(self) -> None:
        """Close the pipe as soon as no call waits any more; ``wake()`` ends one that does."""
        with self._lock:
            self._pipe.close()


def _pickled(number: int, method: str, args: tuple) -> bytes:
    try:
        return pickle.dumps((number, method, args), 5)
    except RecursionError:
        # The JSON reader allows deeper nesting than the pickler does.
        raise GymServerError(
            "malformed_json",
            "The request's body has too many lists in one another to be handed on",
        ) from None


def _read_result(raw: bytes, trusted: bool) -> Any:
    _, kind, length = _HEAD.unpack_from(raw)
    if kind == _OBJECT and trusted:
        return pickle.loads(memoryview(raw)[_HEAD.size :])
    if kind in _CONTENT_TYPES:
        return Ready(raw[_HEAD.size :], _CONTENT_TYPES[kind], length)
    end = _HEAD.size + length
    if end > len(raw):
        raise MalformedMessageError("a text that is cut off")
    try:
        value = json.loads(raw[_HEAD.size : end])
    except (ValueError, RecursionError):
        raise MalformedMessageError("a text that is no JSON") from None
    if kind == _REFUSAL:
        raise _refusal(value)
    if kind != _VALUE or not isinstance(value, list) or len(value) != 2:
        raise MalformedMessageError("an answer of no kind")
    return Result(value[0], _frame(value[1], raw, end))


def _refusal(value: object) -> Exception:
    if not isinstance(value, dict):
        return MalformedMessageError("an error that is none")
    parts: list[Any] = [value.get(name) for name in ("code", "message", "hint", "extra")]
    if not all(part is None or isinstance(part, str) for part in parts):
        return MalformedMessageError("an error that is none")
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
        raise MalformedMessageError("a picture of another size than its shape")
    return np.frombuffer(raw, np.uint8, offset=begin).reshape(shape)
