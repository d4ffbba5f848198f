"""What the server and the process of an isolated environment say to each other.

The server asks by pickles: what comes from it can be trusted.  What comes back can not: an
environment may have taken its process over.  So the answers are numbers, JSON and bytes, each
looked at before it is believed, and nothing in them names code.
"""

from __future__ import annotations

import json
import math
import pickle
import struct
import threading
import time
from multiprocessing.connection import Connection
from typing import NamedTuple

import numpy as np

from gym_server.errors import GymServerError
from gym_server.processes.pipe import Nonsense, Pipe
from gym_server.protocol.answers import JSON, Answer, Ready, dumps
from gym_server.protocol.safetensors import TENSORS

# The question's number, what kind of answer it is, and how long its text is.
_HEAD = struct.Struct("<QBI")

_REFUSAL, _VALUE, _JSON, _TENSORS = range(4)

_CONTENT_TYPES = {_JSON: JSON, _TENSORS: TENSORS}

_LONGEST_TEXT = 100_000


class Seen(NamedTuple):
    """A JSON value, and a picture or None."""

    value: object
    frame: np.ndarray | None


# The process's side -------------------------------------------------------------------------


def read_question(raw: bytes) -> tuple[int, str, tuple]:
    """Return a question's number, the method that it calls, and the arguments."""
    return pickle.loads(raw)


def answer_of(number: int, answer: Answer) -> bytes:
    """Return the message that is the answer to a reset or a step."""
    kind = _TENSORS if answer.content_type == TENSORS else _JSON
    return _HEAD.pack(number, kind, 0) + answer.body


def value_of(number: int, value: object, frame: np.ndarray | None = None) -> bytes:
    """Return the message that is a JSON value, with a picture."""
    text = dumps([value, None if frame is None else frame.shape])
    pixels = b"" if frame is None else frame.tobytes()
    return _HEAD.pack(number, _VALUE, len(text)) + text + pixels


def refusal_of(number: int, refusal: dict[str, str]) -> bytes:
    """Return the message that is an error; see ``errors.answer_to()``."""
    text = dumps(refusal)
    return _HEAD.pack(number, _REFUSAL, len(text)) + text


# The server's side --------------------------------------------------------------------------


class Channel:
    """Asks the process one question at a time.

    Attributes:
        busy_since: since when an answer is waited for, in the clock's seconds; None while none
            is.
    """

    def __init__(self, connection: Connection) -> None:
        """Take over the server's end of a pipe."""
        self._pipe = Pipe(connection)
        self._lock = threading.Lock()
        self._number = 0
        self.busy_since: float | None = None

    def ask(self, method: str, *args: object, seconds: float | None = None) -> Ready | Seen:
        """Call a method in the process.

        Args:
            method: its name.
            *args: what it is called with; they are pickled.
            seconds: how long to wait; None for as long as it takes.

        Returns:
            ``Ready`` for a reset or a step, else ``Seen``.

        Raises:
            GymServerError: what the process refused with; ``malformed_json``.
            EOFError, OSError: the process is gone.
            TimeoutError: it took too long; its answer will be nobody's.
            Nonsense: what it said is no answer.
        """
        if not self._lock.acquire(timeout=-1 if seconds is None else seconds):
            raise TimeoutError
        self.busy_since = time.monotonic()
        try:
            self._number += 1
            self._pipe.send(_question(self._number, method, args))
            return self._hear(seconds)
        finally:
            self.busy_since = None
            self._lock.release()

    def hear(self) -> Ready | Seen:
        """Wait for the first word, which answers no question; see ``ask()``."""
        with self._lock:
            return self._hear(None)

    def _hear(self, seconds: float | None) -> Ready | Seen:
        while True:
            if seconds is not None and not self._pipe.has_come(seconds):
                raise TimeoutError
            raw = self._pipe.receive()
            number = _HEAD.unpack_from(raw)[0] if len(raw) >= _HEAD.size else -1
            if number == self._number:
                return _read_answer(raw)
            # Else it is the answer to one that had no more time.
            if not 0 < number < self._number:
                raise Nonsense("an answer that nobody asked for")

    def wake(self) -> None:
        """Let whoever waits here find that the process is gone."""
        self._pipe.wake()

    def close(self) -> None:
        """Close the pipe when nobody waits here any more; ``wake()`` sees to that."""
        with self._lock:
            self._pipe.close()


def _question(number: int, method: str, args: tuple) -> bytes:
    try:
        return pickle.dumps((number, method, args), 5)
    except RecursionError:
        # JSON that could be read is not always flat enough for this.
        raise GymServerError(
            "malformed_json",
            "The request's body has too many lists in one another to be handed on",
        ) from None


def _read_answer(raw: bytes) -> Ready | Seen:
    _, kind, length = _HEAD.unpack_from(raw)
    if kind in _CONTENT_TYPES:
        return Ready(raw[_HEAD.size :], _CONTENT_TYPES[kind])
    end = _HEAD.size + length
    if end > len(raw):
        raise Nonsense("a text that is cut off")
    try:
        value = json.loads(raw[_HEAD.size : end])
    except (ValueError, RecursionError):
        raise Nonsense("a text that is no JSON") from None
    if kind == _REFUSAL:
        raise _refusal(value)
    if kind != _VALUE or not isinstance(value, list) or len(value) != 2:
        raise Nonsense("an answer of no kind")
    return Seen(value[0], _frame(value[1], raw, end))


def _refusal(value: object) -> Exception:
    if not isinstance(value, dict):
        return Nonsense("an error that is none")
    parts = [value.get(name) for name in ("code", "message", "hint", "extra")]
    if not all(part is None or isinstance(part, str) for part in parts):
        return Nonsense("an error that is none")
    if not parts[0] or not parts[0].isidentifier() or parts[1] is None:
        return Nonsense("an error without a name")
    code, *others = (part and part[:_LONGEST_TEXT] for part in parts)
    refusal = GymServerError(code, *others)
    refusal.is_logged = True
    return refusal


def _frame(shape: object, raw: bytes, begin: int) -> np.ndarray | None:
    if shape is None:
        return None
    is_shape = isinstance(shape, list) and all(type(n) is int and n > 0 for n in shape)
    if not is_shape or len(shape) != 3 or shape[2] not in (1, 3, 4):
        raise Nonsense("a picture without a shape")
    if math.prod(shape) != len(raw) - begin:
        raise Nonsense("a picture of another size than its shape")
    return np.frombuffer(raw, np.uint8, offset=begin).reshape(shape)
