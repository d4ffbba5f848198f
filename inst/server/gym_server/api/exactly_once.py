"""Requests with an idempotency key are done once, however often they arrive.

libcurl silently sends a POST again when a kept-alive connection broke before an answer came.
A step must not be taken twice for that, so a client may put an idempotency key into its requests:
a key of its own, and a number that grows. A repetition gets the stored answer.

A client can exhaust what is kept of its own instances only, and can make nothing of other
clients' be forgotten:

- A key belongs to the instance that it is used on, and numbers grow for each instance by itself.
  To use up somebody else's key by a huge number, one would have to send it to that client's
  instance, and could as well close that. Creations have no order at all: each key with its number
  stands for one of them.
- A call that was refused before anything was done leaves nothing behind.
- As long as an instance lives, so does what is known of the last call on it and of its creation.
  Other keys of the same instance are known for a quarter of an hour, and a new one is refused
  where there are very many of them.
- What is known of an instance that is gone may be dropped at any time: a repetition could do
  nothing any more.
- Where all answers together take too much memory the largest ones are dropped, those of last calls
  last. It stays known that the call was done: its repetition is refused and does nothing.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable
from typing import Any, Generic, NamedTuple, TypeVar

from gym_server.errors import GymServerError
from gym_server.protocol.fields import RequestId
from gym_server.threads.in_progress import InProgress

AnswerT = TypeVar("AnswerT")

# What is kept is searched for what may be dropped after so many seconds, or when this share of the
# memory that it may take was stored anew.
_SEARCH_SECONDS = 30.0
_SEARCH_SHARE = 1 / 8


class _Doing(NamedTuple):
    """A request that a thread is doing."""

    thread: int
    request_id: RequestId


class Outcome(NamedTuple):
    """What came of a request.

    Attributes:
        answer: what the client gets.
        did_something: whether to do it again could make a difference.
        instance_id: the instance that it used or created; None where there is none.
    """

    answer: Any
    did_something: bool = True
    instance_id: str | None = None


class _Latest(Generic[AnswerT]):
    """The newest request of one key to one instance, or a creation, and its answer."""

    def __init__(self, instance_id: str | None, name: Hashable) -> None:
        self.lock = threading.Lock()
        # Where it is kept; what creates or ends an instance is kept under None.
        self.place = instance_id, name
        self.is_dropped = False
        self.instance_id = instance_id
        self.number = -1
        self.content: Hashable = None
        # None also where it took too much memory.
        self.answer: AnswerT | None = None
        self.stored = 0.0


class ExactlyOnce(Generic[AnswerT]):
    """The last answer of each key to each instance."""

    def __init__(
        self,
        lives: Callable[[str], bool],
        size: Callable[[Hashable, AnswerT | None], int] = lambda content, answer: 0,
        forget_after: float = 15 * 60,
        most_keys: int = 256,
        most_gone: int = 10_000,
        most_bytes: int = 2**29,
    ) -> None:
        """Start with no keys.

        Args:
            lives: tells whether there is an instance of this id.
            size: tells how many bytes are kept of a request and its answer.
            forget_after: after how many seconds ``forget()`` drops what may be dropped.
            most_keys: how many keys an instance takes in that time.
            most_gone: how many of instances that are gone ``forget()`` leaves.
            most_bytes: how many bytes of answers it leaves.
        """
        self._lives = lives
        self._size = size
        self._forget_after = forget_after
        self._most_keys = most_keys
        self._most_gone = most_gone
        self._most_bytes = most_bytes
        self._lock = threading.Lock()
        self._searched = time.monotonic()
        self._bytes_since_search = 0
        # The requests that are being done, each by the thread that does it and its idempotency key.
        self._doing: InProgress[_Doing, tuple[_Latest[AnswerT], Hashable]] = InProgress()
        # By the instance that is used, and there by the key. Requests that create or end an
        # instance stand under None, by key and number.
        self._calls: dict[str | None, dict[Hashable, _Latest[AnswerT]]] = {}

    def answer(
        self,
        request_id: RequestId,
        instance_id: str | None,
        content: Hashable,
        act: Callable[[], Outcome],
    ) -> AnswerT:
        """Do what a request asks, or return the answer that it got before.

        Args:
            request_id: its idempotency key.
            instance_id: the instance that it uses; None for what creates or ends one.
            content: what the request asks; a repetition has the same.
            act: does it, and must not raise; called at most once per number, unless it did
                nothing.

        Raises:
            GymServerError: ``request_conflict`` when the number was used for something else,
                lies before the newest, or its answer is not kept any more; ``too_many_keys``.
        """
        # Its lock is held while the request is done: a repetition that arrives meanwhile waits for
        # the answer of the first.
        latest = self._acquire(request_id, instance_id)
        doing = _Doing(threading.get_ident(), request_id)
        self._doing.begin(doing, (latest, content))
        try:
            if request_id.number <= latest.number:
                return _repeat(latest, request_id, content)
            outcome = act()
            answer: AnswerT = outcome.answer
            if outcome.did_something and self._doing.finish(doing):
                latest.instance_id = outcome.instance_id
                self._store(latest, request_id, content, answer)
            return answer
        finally:
            if self._doing.finish(doing):
                if latest.number < 0:
                    self._drop(latest)
                latest.lock.release()

    def abandon(self, thread: int, refuse: Callable[[RequestId], AnswerT]) -> AnswerT | None:
        """Answer what a thread is doing that is stuck; its own answer, if it comes, is dropped.

        The thread may come back at this very moment; ``InProgress`` says who stores the answer and
        releases the lock then.

        Args:
            thread: the thread.
            refuse: makes the answer, for repetitions as well.

        Returns:
            The answer; None when the thread does nothing that has an idempotency key.
        """
        for doing, (latest, content) in self._doing.items():
            if doing.thread == thread and self._doing.abandon(doing):
                answer = refuse(doing.request_id)
                self._store(latest, doing.request_id, content, answer)
                self._doing.answered(doing)
                return answer
        return None

    def _acquire(self, request_id: RequestId, instance_id: str | None) -> _Latest[AnswerT]:
        """Return what is known of a key, and take its lock."""
        name = request_id if instance_id is None else request_id.key
        while True:
            with self._lock:
                calls = self._calls.get(instance_id)
                if calls is None:
                    calls = self._calls[instance_id] = {}
                latest = calls.get(name)
                if latest is None:
                    if instance_id is not None and len(calls) >= self._most_keys:
                        raise _too_many_keys(instance_id, self._most_keys, self._forget_after)
                    latest = calls[name] = _Latest(instance_id, name)
            latest.lock.acquire()
            if not latest.is_dropped:
                return latest
            # Meanwhile another thread found that the request had done nothing.
            latest.lock.release()

    def _store(
        self, latest: _Latest[AnswerT], request_id: RequestId, content: Hashable, answer: AnswerT
    ) -> None:
        latest.answer = answer
        latest.number = request_id.number
        latest.content = content
        latest.stored = time.monotonic()
        latest.lock.release()
        # Not exact where several threads are here at once, and need not be.
        self._bytes_since_search += self._size(content, answer)

    def _drop(self, latest: _Latest[AnswerT]) -> None:
        """Forget an entry whose lock the caller has."""
        if latest.is_dropped:
            return
        latest.is_dropped = True
        instance_id, name = latest.place
        with self._lock:
            calls = self._calls[instance_id]
            del calls[name]
            if not calls:
                del self._calls[instance_id]

    def _all(self) -> list[_Latest[AnswerT]]:
        with self._lock:
            return [latest for calls in self._calls.values() for latest in calls.values()]

    def forget_in_time(self) -> None:
        """Call ``forget()`` if some time has gone by, or much was stored, since the last time.

        With very many keys a search of all of them takes some tenths of a second.
        """
        is_due = time.monotonic() > self._searched + _SEARCH_SECONDS
        if is_due or self._bytes_since_search > self._most_bytes * _SEARCH_SHARE:
            self._searched = time.monotonic()
            self._bytes_since_search = 0
            self.forget()

    def forget(self) -> None:
        """Drop what need not be known any more, and answers where they take too much memory."""
        known = [
            _Known(latest, latest.stored, self._size(latest.content, latest.answer))
            for latest in self._all()
            if latest.stored
        ]
        known.sort(key=lambda one: one.stored)
        gone = [one for one in known if not self._is_of_living(one.latest)]
        is_gone = set(map(id, gone))
        # Of each instance the one that was stored last.
        last = {one.latest.place[0]: one for one in known}
        needed = {
            id(one)
            for one in known
            if id(one) not in is_gone
            and (one.latest.place[0] is None or last[one.latest.place[0]] is one)
        }
        before = time.monotonic() - self._forget_after
        surplus = gone[: max(0, len(gone) - self._most_gone)]
        old = [one for one in known if one.stored < before and id(one) not in needed]
        dropped = {id(one): one for one in (*surplus, *old)}
        for one in dropped.values():
            one.change_unless_used(self._drop)
        kept = [one for one in known if id(one) not in dropped]
        excess = sum(one.size for one in kept) - self._most_bytes
        if excess > 0:
            kept.sort(key=lambda one: (id(one) in needed, -one.size))
            _lighten(kept, excess)

    def _is_of_living(self, latest: _Latest[AnswerT]) -> bool:
        return latest.instance_id is not None and self._lives(latest.instance_id)


class _Known(NamedTuple):
    """What ``forget()`` saw of a key: when its answer was stored, and how many bytes it holds."""

    latest: _Latest
    stored: float
    size: int

    def change_unless_used(self, change: Callable[[_Latest], None]) -> None:
        """Change it, unless it is in use at this moment or was used since."""
        if self.latest.lock.acquire(blocking=False):
            if self.latest.stored == self.stored:
                change(self.latest)
            self.latest.lock.release()


def _lighten(kept: list[_Known], excess: int) -> None:
    """Drop so many bytes of answers, the first ones."""
    for one in kept:
        if excess <= 0:
            return
        one.change_unless_used(_drop_answer)
        excess -= one.size


def _drop_answer(latest: _Latest) -> None:
    latest.answer = latest.content = None


def _repeat(latest: _Latest[AnswerT], request_id: RequestId, content: Hashable) -> AnswerT:
    """Return the stored answer."""
    if request_id.number < latest.number:
        raise _conflict(request_id, f"came after number {latest.number}")
    if latest.answer is None:
        raise GymServerError(
            "request_conflict",
            f"Request number {request_id.number} of key '{request_id.key}' was done before, but "
            "its answer was too large to be kept; nothing was done again",
            "reset the environment, or ask for less at once",
        )
    if content != latest.content:
        raise _conflict(request_id, "was already used for another request")
    return latest.answer


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
