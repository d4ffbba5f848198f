"""Work in progress that exactly one thread ends: its own, or the watchdog that answers for it."""

from __future__ import annotations

import threading
from collections.abc import Hashable
from typing import TypeVar

KeyT = TypeVar("KeyT", bound=Hashable)
ValueT = TypeVar("ValueT")

# Longer than it takes to send a short response to a client that does not read.
ANSWERED_SECONDS = 5.0


class InProgress(dict[KeyT, ValueT]):
    """The work that threads are doing: any information about each piece, under a unique key.

    A thread that is stuck in an environment cannot answer its client. A watchdog abandons its work
    and answers for it. The thread may return with a result at that very moment:

    1. The worker adds its work to the dict, and starts something that may take too long.
    2. Either the worker returns first and calls ``finish()``, which returns True: the result is
       valid, and the watchdog's ``abandon()`` returns False from then on.
    3. Or the watchdog calls ``abandon()`` first, which returns True: the watchdog must answer, and
       the worker's ``finish()`` returns False from then on. If both call at once, only one of them
       can take the key out of the dict, and the other finds it gone.
    4. The watchdog answers the client and interrupts the worker.
    5. If the worker returns meanwhile, it drops its result, cleans up, and calls
       ``wait_until_answered()``. Otherwise its thread could already be serving the next request
       when the answer or the interrupt of step 4 arrives.
    6. The watchdog calls ``answered()``, and the worker continues.

    A worker that does not serve clients itself may skip step 5 and end.
    """

    __slots__ = ("_abandoned",)

    def __init__(self) -> None:
        """Start with no work."""
        super().__init__()
        self._abandoned: dict[KeyT, threading.Event] = {}

    def finish(self, key: KeyT) -> bool:
        """End a piece of work; return False if it was abandoned or has ended."""
        return self.pop(key, _NONE) is not _NONE

    def abandon(self, key: KeyT) -> bool:
        """Take a piece of work from its thread; return False if it is not in progress."""
        # Set the event first: the worker may find its work gone and wait for the answer.
        answered = threading.Event()
        if self._abandoned.setdefault(key, answered) is not answered:
            return False
        if self.finish(key):
            return True
        del self._abandoned[key]
        return False

    def answered(self, key: KeyT) -> None:
        """Let the thread whose work was abandoned continue: its client was answered."""
        answered = self._abandoned.pop(key, None)
        if answered is not None:
            answered.set()

    def wait_until_answered(self, key: KeyT) -> None:
        """Wait until the watchdog has answered; called by the thread whose work was abandoned."""
        answered = self._abandoned.get(key)
        if answered is not None:
            answered.wait(ANSWERED_SECONDS)


_NONE = object()
