"""Requests with an idempotency key are done once, however often they arrive.

libcurl silently sends a POST again when a kept-alive connection broke before an answer came.
A step must not be taken twice for that, so a client may put an idempotency key into its requests:
a key of its own, and a number that grows. A repetition gets the stored response.

What is known is a table with a row for the last request of each key to each instance. A key belongs
to the instance that it is used on, and numbers grow for each instance by itself: nobody uses up
somebody else's key. Creations have no order at all: each key with its number has a row.

- A call that was refused before anything was done leaves no row.
- All stored responses have a limit in bytes. Beyond it the largest ones are dropped, but not their
  rows: the repetition of such a request is refused, and does nothing.
- Rows of an instance that is gone are dropped at some time: a repetition could do nothing any more.
- An instance has a limit of rows. Those that are older than a quarter of an hour make room for new
  ones, that of the last call never does.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable
from typing import NamedTuple

from gym_server.errors import GymServerError
from gym_server.protocol.fields import RequestId
from gym_server.response import Response
from gym_server.threads.in_progress import InProgress

# When there are too many bytes, so much is dropped that there is room for a while.
_SHARE_LEFT = 7 / 8


class _Doing(NamedTuple):
    """A request that a thread is doing."""

    thread: int
    request_id: RequestId


class Outcome(NamedTuple):
    """What came of a request.

    Attributes:
        response: what the client gets.
        did_something: whether to do it again could make a difference.
        instance_id: the instance that it used or created; None where there is none.
    """

    response: Response
    did_something: bool = True
    instance_id: str | None = None


class _Row:
    """The last request of one key to one instance, or a creation.

    Attributes:
        lock: held while the request is done: a repetition that arrives meanwhile waits for it.
        place: where it stands in the table.
        is_dropped: whether it stands there no more.
        instance_id: the instance that it used or created.
        number: of the request; -1 before the first.
        kept: what was asked, and the response; None where that took too much memory.
        size: bytes of both.
        stored: when that was, in the clock's seconds.
    """

    __slots__ = (
        "instance_id",
        "is_dropped",
        "kept",
        "lock",
        "number",
        "place",
        "size",
        "stored",
    )

    def __init__(self, instance_id: str | None, name: Hashable) -> None:
        self.lock = threading.Lock()
        self.place = instance_id, name
        self.is_dropped = False
        self.instance_id = instance_id
        self.number = -1
        self.kept: tuple[Hashable, Response] | None = None
        self.size = 0
        self.stored = 0.0


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
        """Start with no keys.

        Args:
            lives: tells whether there is an instance of this id.
            most_bytes: of all stored responses.
            most_keys: how many keys an instance takes.
            kept_seconds: after how many seconds one of them makes room for another.
            most_gone: how many rows come before those of instances that are gone are dropped.
        """
        self._lives = lives
        self._most_bytes = most_bytes
        self._most_keys = most_keys
        self._kept_seconds = kept_seconds
        self._most_gone = most_gone
        # Guards the table; never held while a row's lock is waited for.
        self._lock = threading.Lock()
        # By the instance that is used, and there by the key. Requests that create or end an
        # instance stand under None, by key and number.
        self._table: dict[str | None, dict[Hashable, _Row]] = {}
        self._bytes = 0
        self._rows_since_sweep = 0
        # The requests that are being done, each with its row and what it asks.
        self._doing: InProgress[_Doing, tuple[_Row, Hashable, int]] = InProgress()

    def respond(
        self,
        request_id: RequestId,
        instance_id: str | None,
        content: Hashable,
        size: int,
        act: Callable[[], Outcome],
    ) -> Response:
        """Do what a request asks, or return the response that it got before.

        Args:
            request_id: its idempotency key.
            instance_id: the instance that it uses; None for what creates or ends one.
            content: what the request asks; a repetition has the same.
            size: bytes of that.
            act: does it, and must not raise; called at most once per number, unless it did
                nothing.

        Raises:
            GymServerError: ``request_conflict`` when the number was used for something else,
                lies before the newest, or its response is not kept any more; ``too_many_keys``.
        """
        row = self._acquire(request_id, instance_id)
        doing = _Doing(threading.get_ident(), request_id)
        self._doing.begin(doing, (row, content, size))
        try:
            if request_id.number <= row.number:
                return _repeat(row, request_id, content)
            outcome = act()
            if outcome.did_something and self._doing.finish(doing):
                row.instance_id = outcome.instance_id
                self._store(row, request_id, content, size, outcome.response)
            return outcome.response
        finally:
            if self._doing.finish(doing):
                if row.number < 0:
                    with self._lock:
                        self._drop(row)
                row.lock.release()

    def abandon(self, thread: int, refuse: Callable[[RequestId], Response]) -> Response | None:
        """Answer what a thread is doing that is stuck; its own response, if it comes, is dropped.

        The thread may come back at this very moment; ``InProgress`` says who stores the response
        and releases the lock then.

        Args:
            thread: the thread.
            refuse: makes the response, for repetitions as well.

        Returns:
            The response; None when the thread does nothing that has an idempotency key.
        """
        for doing, (row, content, size) in self._doing.items():
            if doing.thread == thread and self._doing.abandon(doing):
                response = refuse(doing.request_id)
                self._store(row, doing.request_id, content, size, response)
                self._doing.answered(doing)
                return response
        return None

    def _acquire(self, request_id: RequestId, instance_id: str | None) -> _Row:
        """Return the row of a key, and take its lock."""
        name = request_id if instance_id is None else request_id.key
        while True:
            with self._lock:
                row = self._table.get(instance_id, {}).get(name)
                if row is None:
                    self._make_room_for_row(instance_id)
                    row = _Row(instance_id, name)
                    self._table.setdefault(instance_id, {})[name] = row
            row.lock.acquire()
            if not row.is_dropped:
                return row
            # Meanwhile another thread found that the request had done nothing.
            row.lock.release()

    def _store(
        self, row: _Row, request_id: RequestId, content: Hashable, size: int, response: Response
    ) -> None:
        """Store a response in a row, and release its lock."""
        size += len(response.body)
        with self._lock:
            row.kept = content, response
            row.number = request_id.number
            row.stored = time.monotonic()
            self._bytes += size - row.size
            row.size = size
            if self._bytes > self._most_bytes:
                self._drop_largest()
        row.lock.release()

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
        """Drop the rows of instances that are gone."""
        for row in [row for rows in self._table.values() for row in rows.values()]:
            if row.stored and (row.instance_id is None or not self._lives(row.instance_id)):
                self._drop_unless_used(row)

    def _drop_unless_used(self, row: _Row) -> None:
        if row.lock.acquire(blocking=False):
            self._drop(row)
            row.lock.release()

    def _drop(self, row: _Row) -> None:
        """Drop a row whose lock the caller has."""
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
            "its answer was too large to be kept; nothing was done again",
            "reset the environment, or ask for less at once",
        )
    asked, response = row.kept
    if content != asked:
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
        f"{most} keys have moved instance {instance_id} in the last {seconds / 60:g} minutes, and "
        "it takes no more; nothing was done",
        "use one key for all requests of a process, and number them upwards; in R each session and "
        "each forked process has one",
    )
