"""Requests with an idempotency key are done once, however often they arrive.

libcurl silently repeats a POST when a kept-alive connection breaks before a response arrives. That
must not take a step twice, so a client may put an idempotency key into its requests: its own key,
and a growing number. A repeated request gets the stored response.

Each instance has a row for the last request of each key. Requests that create or close an instance
have no order: each key with its number has a row. The responses share a limit in bytes. Beyond it
the oldest are dropped, but not their rows: repeating such a request does nothing and is an error.
"""

from __future__ import annotations

import secrets
import threading
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from hashlib import blake2b

from gym_server.errors import GymServerError
from gym_server.protocol.fields import RequestId
from gym_server.response import Response

# The text by which clients tell this server from one that ran before at the same address.
START = secrets.token_hex(8)

# Longer bodies are stored as a digest, which takes 80 us for one of this size.
_KEPT_BYTES = 2**17


def kept_body(raw: bytes) -> bytes:
    """Return what tells a request's body from another one's."""
    return raw if len(raw) <= _KEPT_BYTES else blake2b(raw).digest()


@dataclass(slots=True, eq=False)
class _Row:
    """The last request of one key to one instance, or one that created or closed an instance.

    Attributes:
        lock: held while the request is in progress; a repetition waits for it.
        number: the request's number; -1 before the first.
        asked: the request's contents.
        response: the response; None if it was dropped.
    """

    lock: threading.Lock = field(default_factory=threading.Lock)
    number: int = -1
    asked: Hashable = None
    response: Response | None = None


class ExactlyOnce:
    """The last response to each key on each instance."""

    def __init__(
        self,
        lives: Callable[[str], bool],
        most_bytes: int = 2**29,
        most_unordered: int = 10_000,
    ) -> None:
        """Start without keys.

        Args:
            lives: returns whether an instance exists.
            most_bytes: the limit of all stored responses.
            most_unordered: how many requests that created or closed an instance are remembered one
                by one. Of older ones only the highest number of each key is.
        """
        self._lives = lives
        self._most_bytes = most_bytes
        self._most_unordered = most_unordered
        # Guards what follows; never held while waiting for a row's lock.
        self._lock = threading.Lock()
        self._rows: dict[str, dict[str, _Row]] = {}
        self._unordered: dict[RequestId, _Row] = {}
        self._forgotten: dict[str, int] = {}
        # The bytes of the rows that have a response, in the order of the responses.
        self._sizes: dict[_Row, int] = {}
        self._bytes = 0

    def respond(
        self,
        request_id: RequestId,
        instance_id: str | None,
        asked: Hashable,
        size: int,
        act: Callable[[], tuple[Response, bool]],
    ) -> Response:
        """Do a request, or return the stored response.

        Args:
            request_id: its idempotency key.
            instance_id: the instance that it uses; None if it creates or closes one.
            asked: its contents, which are the same in a repetition.
            size: the bytes of the contents.
            act: does the request and must not raise; returns the response, and whether doing it
                again could make a difference. Called at most once per number, unless it could not.

        Raises:
            GymServerError: ``request_conflict`` if the number was used for another request, is
                smaller than the newest, or its response was dropped.
        """
        key, number = request_id
        if instance_id is not None and not self._lives(instance_id):
            # No request to it was done, or none matters any more.
            return act()[0]
        with self._lock:
            if instance_id is not None:
                row = self._rows.setdefault(instance_id, {}).get(key)
                if row is None:
                    row = self._rows[instance_id][key] = _Row()
            else:
                row = self._unordered_row(request_id)
        with row.lock:
            if number <= row.number:
                return _repeat(row, request_id, asked)
            response, did_something = act()
            if did_something:
                row.number, row.asked, row.response = number, asked, response
                self._count(row, size + len(response.body))
            return response

    def _unordered_row(self, request_id: RequestId) -> _Row:
        """Return the row of a request that creates or closes an instance."""
        key, number = request_id
        row = self._unordered.get(request_id)
        if row is None:
            if number <= self._forgotten.get(key, -1):
                raise _conflict(request_id, "came after many others")
            row = self._unordered[request_id] = _Row()
            if len(self._unordered) > self._most_unordered:
                oldest = next(iter(self._unordered))
                self._drop(self._unordered.pop(oldest))
                self._forgotten[oldest.key] = max(
                    oldest.number, self._forgotten.get(oldest.key, -1)
                )
        return row

    def _count(self, row: _Row, size: int) -> None:
        """Count the bytes of a row's new response, and drop the oldest if they are too many."""
        with self._lock:
            self._bytes += size - self._sizes.pop(row, 0)
            self._sizes[row] = size
            while self._bytes > self._most_bytes:
                self._drop(next(iter(self._sizes)))

    def _drop(self, row: _Row) -> None:
        self._bytes -= self._sizes.pop(row, 0)
        row.response = None

    def forget_closed(self) -> None:
        """Drop the rows of instances that exist no longer, because repetitions do nothing there."""
        with self._lock:
            for instance_id in [one for one in self._rows if not self._lives(one)]:
                for row in self._rows.pop(instance_id).values():
                    self._drop(row)


def _repeat(row: _Row, request_id: RequestId, asked: Hashable) -> Response:
    """Return the stored response."""
    if request_id.number < row.number:
        raise _conflict(request_id, f"came after number {row.number}")
    response = row.response
    if response is None:
        raise GymServerError(
            "request_conflict",
            f"Request number {request_id.number} of key '{request_id.key}' was done before, but "
            "its response was too large to keep; nothing was done again",
            "reset the environment, or request less at once",
        )
    # A stream asks for the same in other bytes than HTTP, where these are part of a tuple.
    if type(asked) is type(row.asked) and asked != row.asked:
        raise _conflict(request_id, "was already used for another request")
    return response


def _conflict(request_id: RequestId, reason: str) -> GymServerError:
    return GymServerError(
        "request_conflict",
        f"Request number {request_id.number} of key '{request_id.key}' {reason}; nothing was done",
        "number the requests of a key upwards, and give each copy of a client its own key",
    )
