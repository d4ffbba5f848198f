"""Requests that a client numbers are done once, however often they arrive.

libcurl silently sends a POST again when a kept-alive connection broke before an answer came.
A step must not be taken twice for that, so a client may put a key and a growing number into
its requests; a repetition gets the stored answer.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable
from typing import Generic, NamedTuple, TypeVar

from gym_server.errors import GymServerError

AnswerT = TypeVar("AnswerT")


class RequestId(NamedTuple):
    """What a client calls one of its requests: its own key (1 to 64 characters), a number."""

    key: str
    number: int


class _Latest(Generic[AnswerT]):
    """The newest request of one key, and its answer."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        # What the thread that has the lock is doing. Whoever takes the entry out, which only
        # one thread can, stores the answer and releases the lock.
        self.doing: dict[int, tuple[RequestId, Hashable]] = {}
        self.number = -1
        self.content: Hashable = None
        self.answer: AnswerT | None = None
        self.used = time.monotonic()


class ExactlyOnce(Generic[AnswerT]):
    """The last answer of each key."""

    def __init__(
        self,
        forget_after: float = 15 * 60,
        most: int = 10_000,
        size: Callable[[Hashable, AnswerT], int] = lambda content, answer: 0,
        most_bytes: int = 2**29,
    ) -> None:
        """Start with no keys.

        Args:
            forget_after: seconds of idleness after which a key is dropped by ``forget()``, and
                when another comes.
            most: how many keys are kept; the one that was used last goes last.
            size: tells how many bytes are kept of a request and its answer.
            most_bytes: to how many ``forget()`` brings them down.
        """
        self._forget_after = forget_after
        self._most = most
        self._size = size
        self._most_bytes = most_bytes
        self._lock = threading.Lock()
        self._keys: dict[str, _Latest[AnswerT]] = {}

    def answer(
        self, request_id: RequestId, content: Hashable, act: Callable[[], AnswerT]
    ) -> AnswerT:
        """Do what a request asks, or return the answer that it got before.

        Args:
            request_id: the key and number that the client gave it.
            content: what the request asks; a repetition has the same.
            act: does it; called at most once per number, must not raise.

        Raises:
            GymServerError: ``request_conflict`` when the number was used for something else
                or lies before the newest.
        """
        latest = self._latest(request_id.key)
        # Held while the environment moves: a repetition that arrives meanwhile waits for the
        # answer of the first.
        latest.lock.acquire()
        thread = threading.get_ident()
        latest.doing[thread] = request_id, content
        try:
            if request_id.number < latest.number:
                raise _conflict(request_id, f"came after number {latest.number}")
            if request_id.number == latest.number:
                if content != latest.content:
                    raise _conflict(request_id, "was already used for another request")
                return latest.answer  # type: ignore[return-value]
            answer = act()
            if latest.doing.pop(thread, None) is not None:
                self._store(latest, request_id, content, answer)
            return answer
        finally:
            if latest.doing.pop(thread, None) is not None:
                latest.lock.release()

    def give_up(self, thread: int, refuse: Callable[[RequestId], AnswerT]) -> AnswerT | None:
        """Answer what a thread is doing, which may never come back with an answer.

        Args:
            thread: the thread.
            refuse: makes the answer, for repetitions as well.

        Returns:
            The answer; None when the thread does nothing that is numbered.
        """
        with self._lock:
            keys = list(self._keys.values())
        for latest in keys:
            doing = latest.doing.pop(thread, None)
            if doing is not None:
                request_id, content = doing
                answer = refuse(request_id)
                self._store(latest, request_id, content, answer)
                return answer
        return None

    def _store(
        self, latest: _Latest[AnswerT], request_id: RequestId, content: Hashable, answer: AnswerT
    ) -> None:
        latest.answer = answer
        latest.number = request_id.number
        latest.content = content
        latest.used = time.monotonic()
        latest.lock.release()

    def _latest(self, key: str) -> _Latest[AnswerT]:
        now = time.monotonic()
        with self._lock:
            latest = self._keys.get(key)
            if latest is None:
                self._forget_before(now - self._forget_after)
                if len(self._keys) >= self._most:
                    self._forget_oldest()
                latest = self._keys[key] = _Latest()
            latest.used = now
            return latest

    def forget(self) -> None:
        """Drop the keys that have been idle for so long that nothing is repeated any more.

        And more, the one that was used last goes last, where all together hold too much.
        """
        with self._lock:
            self._forget_before(time.monotonic() - self._forget_after)
            idle = self._idle()
            sizes = [self._size(latest.content, latest.answer) for _, latest in idle]
            excess = sum(sizes) - self._most_bytes
            for (key, _), size in zip(idle, sizes, strict=True):
                if excess <= 0:
                    break
                del self._keys[key]
                excess -= size

    def _forget_before(self, oldest: float) -> None:
        for key, latest in list(self._keys.items()):
            if latest.used < oldest and not latest.lock.locked():
                del self._keys[key]

    def _forget_oldest(self) -> None:
        # A tenth at once: a look at all of them for each new one would take too long.
        for key, _ in self._idle()[: max(1, self._most // 10)]:
            del self._keys[key]

    def _idle(self) -> list[tuple[str, _Latest[AnswerT]]]:
        """Return the keys that have an answer, the one that was used last at the end."""
        idle = [
            item
            for item in self._keys.items()
            if not item[1].lock.locked() and item[1].answer is not None
        ]
        return sorted(idle, key=lambda item: item[1].used)


def _conflict(request_id: RequestId, reason: str) -> GymServerError:
    return GymServerError(
        "request_conflict",
        f"Request number {request_id.number} of key '{request_id.key}' {reason}; nothing was done",
        "number the requests of a key upwards, and give each copy of a client its own key",
    )
