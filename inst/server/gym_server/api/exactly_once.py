"""Requests with an idempotency key are done once, however often they arrive.

libcurl silently repeats a POST when a kept-alive connection breaks before a response arrives. That
must not take a step twice, so a client may put an idempotency key into its requests: its own key,
and a growing number. A repeated request gets the stored response.

A table has a row for the last request of each key to each instance. Each instance has its own keys
and numbers, so nobody uses up somebody else's. Creations have no order: each key with its number
has a row.

- A call that was refused before anything was done leaves no row.
- All stored responses together have a limit in bytes. Beyond it the largest are dropped, but not
  their rows: repeating such a request does nothing and is an error.
- The rows of a closed instance are dropped eventually, because repeating a request to it does
  nothing.
- An instance has a limit of rows. Rows older than a quarter of an hour make room for new ones; the
  row of the last call never does.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from hashlib import blake2b
from typing import NamedTuple

from gym_server.errors import GymServerError
from gym_server.protocol.fields import RequestId
from gym_server.response import Response

# Above the limit of bytes, responses are dropped down to this share of it.
_SHARE_LEFT = 7 / 8


# Longer bodies are stored as a digest, which takes 40 us for one of this size.
_KEPT_BYTES = 2**16


def kept_body(raw: bytes) -> bytes:
    """Return what tells a request's body from another one's."""
    return raw if len(raw) <= _KEPT_BYTES else blake2b(raw).digest()


class Outcome(NamedTuple):
    """The outcome of a request.

    Attributes:
        response: the client's response.
        did_something: whether doing it again could make a difference.
        instance_id: the instance that it used or created; None if none.
    """

    response: Response
    did_something: bool = True
    instance_id: str | None = None


@dataclass(slots=True, eq=False)
class _Row:
    """The last request of one key to one instance, or a creation.

    Attributes:
        place: its place in the table: an instance, and a key.
        instance_id: the instance that it used or created.
        lock: held while the request is in progress; a repetition waits for it.
        is_dropped: whether it was removed from the table.
        number: the request's number; -1 before the first.
        kept: the request and the response; None if that took too much memory.
        size: the bytes of both.
        stored: when it was stored, in the clock's seconds.
    """

    place: tuple[str | None, Hashable]
    instance_id: str | None
    lock: threading.Lock = field(default_factory=threading.Lock)
    is_dropped: bool = False
    number: int = -1
    kept: tuple[Hashable, Response] | None = None
    size: int = 0
    stored: float = 0.0


class ExactlyOnce:
    """The last response to each key on each instance."""

    def __init__(
        self,
        lives: Callable[[str], bool],
        most_bytes: int = 2**29,
        most_keys: int = 256,
        kept_seconds: float = 15 * 60,
        most_gone: int = 10_000,
    ) -> None:
        """Start without keys.

        Args:
            lives: returns whether an instance exists.
            most_bytes: the limit of all stored responses.
            most_keys: the limit of keys per instance.
            kept_seconds: the age at which a key may make room for another.
            most_gone: after how many new rows those of closed instances are dropped.
        """
        self._lives = lives
        self._most_bytes = most_bytes
        self._most_keys = most_keys
        self._kept_seconds = kept_seconds
        self._most_gone = most_gone
        # Guards the table; never held while waiting for a row's lock.
        self._lock = threading.Lock()
        # By instance, and there by key. Requests that create or end an instance are under None, by
        # key and number.
        self._table: dict[str | None, dict[Hashable, _Row]] = {}
        self._bytes = 0
        self._rows_since_sweep = 0

    def respond(
        self,
        request_id: RequestId,
        instance_id: str | None,
        content: Hashable,
        size: int,
        act: Callable[[], Outcome],
    ) -> Response:
        """Do a request, or return the stored response.

        Args:
            request_id: its idempotency key.
            instance_id: the instance that it uses; None if it creates or ends one.
            content: its contents, which are the same in a repetition.
            size: the bytes of the contents.
            act: does the request, and must not raise; called at most once per number, unless it did
                nothing.

        Raises:
            GymServerError: ``request_conflict`` if the number was used for another request, is
                smaller than the newest, or its response was dropped; ``too_many_keys``.
        """
        row = self._acquire(request_id, instance_id)
        outcome = None
        try:
            if request_id.number <= row.number:
                return _repeat(row, request_id, content)
            outcome = act()
            return outcome.response
        finally:
            if outcome is not None and outcome.did_something:
                row.instance_id = outcome.instance_id
                self._store(row, request_id, content, size, outcome.response)
            elif row.number < 0:
                with self._lock:
                    self._drop(row)
            row.lock.release()

    def _acquire(self, request_id: RequestId, instance_id: str | None) -> _Row:
        """Return the row of a key, and take its lock."""
        name = request_id if instance_id is None else request_id.key
        while True:
            with self._lock:
                row = self._table.get(instance_id, {}).get(name)
                if row is None:
                    self._make_room_for_row(instance_id)
                    row = _Row((instance_id, name), instance_id)
                    self._table.setdefault(instance_id, {})[name] = row
            row.lock.acquire()
            if not row.is_dropped:
                return row
            # Another thread dropped the row, because its request did nothing.
            row.lock.release()

    def _store(
        self, row: _Row, request_id: RequestId, content: Hashable, size: int, response: Response
    ) -> None:
        """Store a response in a row; the caller holds its lock."""
        size += len(response.body)
        with self._lock:
            row.kept = content, response
            row.number = request_id.number
            row.stored = time.monotonic()
            self._bytes += size - row.size
            row.size = size
            if self._bytes > self._most_bytes:
                self._drop_largest()

    # With the table's lock ------------------------------------------------------------------

    def _drop_largest(self) -> None:
        """Drop responses until there is room for others."""
        rows = [row for rows in self._table.values() for row in rows.values()]
        for row in sorted(rows, key=lambda row: row.size, reverse=True):
            if self._bytes <= self._most_bytes * _SHARE_LEFT:
                break
            row.kept = None
            self._bytes -= row.size
            row.size = 0

    def _make_room_for_row(self, instance_id: str | None) -> None:
        self._rows_since_sweep += 1
        if self._rows_since_sweep > self._most_gone:
            self._rows_since_sweep = 0
            self._drop_gone()
        rows = self._table.get(instance_id, {})
        if instance_id is None or len(rows) < self._most_keys:
            return
        last = max(row.stored for row in rows.values())
        before = min(last, time.monotonic() - self._kept_seconds)
        for row in [row for row in rows.values() if row.stored < before]:
            self._drop_unless_used(row)
        if len(rows) >= self._most_keys:
            raise _too_many_keys(instance_id, self._most_keys, self._kept_seconds)

    def _drop_gone(self) -> None:
        """Drop the rows of closed instances."""
        for row in [row for rows in self._table.values() for row in rows.values()]:
            if row.stored and (row.instance_id is None or not self._lives(row.instance_id)):
                self._drop_unless_used(row)

    def _drop_unless_used(self, row: _Row) -> None:
        if row.lock.acquire(blocking=False):
            self._drop(row)
            row.lock.release()

    def _drop(self, row: _Row) -> None:
        """Drop a row; the caller holds its lock."""
        row.is_dropped = True
        self._bytes -= row.size
        instance_id, name = row.place
        rows = self._table[instance_id]
        del rows[name]
        if not rows:
            del self._table[instance_id]


def _repeat(row: _Row, request_id: RequestId, content: Hashable) -> Response:
    """Return the stored response."""
    if request_id.number < row.number:
        raise _conflict(request_id, f"came after number {row.number}")
    if row.kept is None:
        raise GymServerError(
            "request_conflict",
            f"Request number {request_id.number} of key '{request_id.key}' was done before, but "
            "its response was too large to keep; nothing was done again",
            "reset the environment, or request less at once",
        )
    asked, response = row.kept
    # A stream asks for the same in other bytes than HTTP, where these are part of a tuple.
    if type(content) is type(asked) and content != asked:
        raise _conflict(request_id, "was already used for another request")
    return response


def _conflict(request_id: RequestId, reason: str) -> GymServerError:
    return GymServerError(
        "request_conflict",
        f"Request number {request_id.number} of key '{request_id.key}' {reason}; nothing was done",
        "number the requests of a key upwards, and give each copy of a client its own key",
    )


def _too_many_keys(instance_id: str, most: int, seconds: float) -> GymServerError:
    return GymServerError(
        "too_many_keys",
        f"Instance {instance_id} got requests with {most} keys in the last {seconds / 60:g} "
        "minutes, the most it allows; nothing was done",
        "use one key for all requests of a process, and number them upwards; in R each session and "
        "each forked process has one",
    )
