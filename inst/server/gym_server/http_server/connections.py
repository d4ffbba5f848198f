"""The connections of a server, and which of them are evicted when more clients come."""

from __future__ import annotations

import ipaddress
import threading
import time
from collections import Counter

from gym_server.http_server.connection import Connection

# Threads that only wait for their client cost some memory.
MOST_CONNECTIONS = 4000

# One address leaves as many to all others. It may be a proxy's, and then all clients come from it;
# they hardly send two thousand requests in the same moment.
MOST_OF_ONE_ADDRESS = MOST_CONNECTIONS // 2

# How many are evicted at once.
EVICTED_AT_ONCE = 100

# The size of all answers that their clients have not read to the end.
MOST_UNSENT_BYTES = 2**28

# How long make_room() waits for the evicted to end, or for one that can be evicted next time.
_MOMENT_SECONDS = 0.1


class Connections:
    """The connections of a server; each is there until its thread has ended."""

    def __init__(self) -> None:
        """Begin with none."""
        self._all: set[Connection] = set()
        # Those that were not evicted, with the address that each comes from.
        self._remaining: dict[Connection, str] = {}
        self._of_address: Counter[str] = Counter()
        self._changed = threading.Condition()

    def __len__(self) -> int:
        return len(self._all)

    def add(self, connection: Connection, address: str) -> bool:
        """Take one in; return whether its address may have one more.

        To make room for it, only connections of the same address are evicted.

        Args:
            connection: the connection.
            address: its client's.
        """
        owner = _owner(address)
        with self._changed:
            if self._of_address[owner] >= MOST_OF_ONE_ADDRESS and not self._evict_some(owner):
                return False
            self._all.add(connection)
            self._remaining[connection] = owner
            self._of_address[owner] += 1
            return True

    def remove(self, connection: Connection) -> None:
        """Forget one, which has ended."""
        with self._changed:
            self._all.discard(connection)
            self._uncount(connection)
            self._changed.notify()

    def served_by(self, thread: int) -> list[Connection]:
        """Return those that this thread serves."""
        with self._changed:
            return [one for one in self._all if one.thread == thread]

    def make_room(self) -> None:
        """Evict some, and wait a moment for them to end."""
        with self._changed:
            self._evict_some()
            self._changed.wait(_MOMENT_SECONDS)

    def _evict_some(self, owner: str | None = None) -> int:
        """Evict in the order of ``Connection.eviction_rank()``; return how many.

        Their clients may connect again.

        Args:
            owner: whose connections; None for anybody's.
        """
        now = time.monotonic()
        ranks = {
            one: rank
            for one, its_owner in self._remaining.items()
            if owner in (None, its_owner) and (rank := one.eviction_rank(now)) is not None
        }
        evicted = 0
        for one in sorted(ranks, key=ranks.__getitem__):
            evicted += self._evict(one)
            if evicted == EVICTED_AT_ONCE:
                break
        return evicted

    def _evict(self, connection: Connection) -> bool:
        is_evicted = connection.evict()
        if is_evicted:
            self._uncount(connection)
        return is_evicted

    def _uncount(self, connection: Connection) -> None:
        owner = self._remaining.pop(connection, None)
        if owner is not None:
            self._of_address[owner] -= 1
            if not self._of_address[owner]:
                del self._of_address[owner]

    def evict_unread(self) -> None:
        """Evict those that wait longest for their answer to be read, while unread ones are many."""
        now = time.monotonic()
        with self._changed:
            unread = [one for one in self._remaining if one.unsent_bytes]
            excess = sum(one.unsent_bytes for one in unread) - MOST_UNSENT_BYTES
            for one in sorted(unread, key=lambda one: one.waiting_since):
                if excess <= 0 or one.eviction_rank(now) is None:
                    break
                size = one.unsent_bytes
                if self._evict(one):
                    excess -= size

    def drain(self, grace: float, half_sent_seconds: float) -> bool:
        """End all that have nothing under way; return whether all have ended in time.

        Args:
            grace: seconds that requests under way may take.
            half_sent_seconds: after how many those are dropped of which only a part has come.
        """
        stopped = time.monotonic()
        with self._changed:
            while self._all and time.monotonic() < stopped + grace:
                half_sent = time.monotonic() > stopped + half_sent_seconds
                for connection in self._all:
                    connection.stop(half_sent)
                self._changed.wait(0.05)
            return not self._all


def _owner(address: str) -> str:
    """Return what the addresses of one owner have in common: in IPv6 a network has 2^64 of them."""
    ip = ipaddress.ip_address(address.partition("%")[0])
    if isinstance(ip, ipaddress.IPv6Address) and ip.ipv4_mapped is None:
        return str(ipaddress.ip_network((ip, 64), strict=False))
    return address
