"""Work that is in progress, which exactly one thread ends: its own, or one that answers for it."""

from __future__ import annotations

import threading
from collections.abc import Hashable
from typing import Generic, TypeVar

KeyT = TypeVar("KeyT", bound=Hashable)
ValueT = TypeVar("ValueT")

# Longer than it takes to send a short answer to a client that does not read.
ANSWERED_SECONDS = 5.0


class InProgress(Generic[KeyT, ValueT]):
    """What threads are working on, each piece of it under a key.

    A thread that is stuck in an environment cannot answer its client, so a watchdog abandons its
    work and answers on its behalf. The thread may come back at that very moment with a result
    after all. A timeline:

    1. The worker calls ``begin()`` and enters what may take too long.
    2. Either the worker comes back first and calls ``finish()``, which returns True: the result is
       valid, and the watchdog's ``abandon()`` returns False from now on.
    3. Or the watchdog calls ``abandon()`` first, which returns True: the watchdog has to answer,
       and the worker's ``finish()`` returns False from now on. When both come at once, one of them
       takes the key out of a dict, which only one thread can, and the other one finds it gone.
    4. The watchdog answers the client, and interrupts the worker.
    5. The worker, where it comes back meanwhile, drops its result, puts away what is left, and
       calls ``wait_until_answered()``. Had it gone on, its thread could be serving the next
       request when the answer of 4 or the interrupt arrives.
    6. The watchdog calls ``answered()``, and the worker goes on.

    A worker that serves no client itself may skip 5, and end.
    """

    __slots__ = ("_abandoned", "_in_progress")

    def __init__(self) -> None:
        """Start with no work."""
        self._in_progress: dict[KeyT, ValueT] = {}
        self._abandoned: dict[KeyT, threading.Event] = {}

    def __len__(self) -> int:
        return len(self._in_progress)

    def items(self) -> list[tuple[KeyT, ValueT]]:
        """Return the work in progress, each piece's key with its value."""
        return list(self._in_progress.items())

    def begin(self, key: KeyT, value: ValueT) -> None:
        """Begin a piece of work.

        Args:
            key: what it is known by; no other work has it at the same time.
            value: whatever is to be known of it.
        """
        self._in_progress[key] = value

    def finish(self, key: KeyT) -> bool:
        """End a piece of work; return False when it was abandoned, or ended before."""
        return self._in_progress.pop(key, _NONE) is not _NONE

    def abandon(self, key: KeyT) -> bool:
        """Take a piece of work away from its thread; return False when it is not in progress."""
        # Before the worker can find its work gone, and wait for the answer.
        answered = threading.Event()
        if self._abandoned.setdefault(key, answered) is not answered:
            return False
        if self._in_progress.pop(key, _NONE) is not _NONE:
            return True
        del self._abandoned[key]
        return False

    def answered(self, key: KeyT) -> None:
        """Let the thread go on from which the work was taken, as it was answered for."""
        answered = self._abandoned.pop(key, None)
        if answered is not None:
            answered.set()

    def wait_until_answered(self, key: KeyT) -> None:
        """Wait, in a thread whose work was abandoned, until it was answered for."""
        answered = self._abandoned.get(key)
        if answered is not None:
            answered.wait(ANSWERED_SECONDS)


_NONE = object()
