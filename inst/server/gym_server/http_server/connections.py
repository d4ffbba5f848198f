"""The connections of a server, and which of them to evict when more clients come."""

from __future__ import annotations

import ipaddress
import threading
import time
from collections import Counter

from gym_server.http_server.connection import Connection

# Each thread that waits for its client costs some memory.
MOST_CONNECTIONS = 4000

# Leaves as many for all other addresses. The address may be a proxy's, which all clients come from;
# they are unlikely to send two thousand requests at once.
MOST_OF_ONE_ADDRESS = MOST_CONNECTIONS // 2

# The number of connections evicted at once.
EVICTED_AT_ONCE = 100

# The total size of responses that clients have not yet read.
MOST_UNSENT_BYTES = 2**28

# How long make_room() waits for evicted connections to end, or for an evictable one to appear.
_MOMENT_SECONDS = 0.1


class Connections:
    """The connections of a server, each until its thread has ended."""

    def __init__(self) -> None:
        """Start with none."""
        self._all: set[Connection] = set()
        # Those that were not evicted, each with its owner, see _owner().
        self._remaining: dict[Connection, str] = {}
        self._of_address: Counter[str] = Counter()
        self._changed = threading.Condition()

    def __len__(self) -> int:
        return len(self._all)

    def add(self, connection: Connection, address: str) -> bool:
        """Add a connection; return False if its address already has too many.

        Makes room by evicting connections of the same address only.

        Args:
            connection: the connection.
            address: its client's address.
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
        """Remove a connection that has ended."""
        with self._changed:
            self._all.discard(connection)
            self._uncount(connection)
            self._changed.notify()

    def make_room(self) -> None:
        """Evict some connections, and wait briefly for them to end."""
        with self._changed:
            self._evict_some()
            self._changed.wait(_MOMENT_SECONDS)

    def _evict_some(self, owner: str | None = None) -> int:
        """Evict in the order of ``Connection.eviction_rank()``; return the number evicted.

        Their clients may connect again.

        Args:
            owner: evict connections of this owner only; None for any owner.
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
        """Evict the slowest readers while unread responses exceed their limit."""
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
        """End all connections without a request in progress; return whether all ended in time.

        Args:
            grace: seconds for requests in progress to finish.
            half_sent_seconds: seconds after which partly received requests are dropped.
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
    """Return what an owner's addresses share: in IPv6 an owner has a network of 2^64 addresses."""
    ip = ipaddress.ip_address(address.partition("%")[0])
    if isinstance(ip, ipaddress.IPv6Address) and ip.ipv4_mapped is None:
        return str(ipaddress.ip_network((ip, 64), strict=False))
    return address
