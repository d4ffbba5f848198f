"""Who is connected, and who leaves when others come."""

from __future__ import annotations

import ipaddress
import threading
import time
from collections import Counter

from gym_server.http_server.connection import Connection

# Threads that only wait for their client cost some memory.
MOST_CONNECTIONS = 4000

# One address leaves as many to all others. It may be a proxy's, and then that of everybody, who
# hardly ask for something two thousand times in the same moment.
MOST_OF_ONE_ADDRESS = MOST_CONNECTIONS // 2

# How many of them leave at once for others.
MAKES_ROOM = 100

# All answers that their clients have not read to the end.
MOST_UNSENT_BYTES = 2**28

# Those who leave need a moment, and so does the next who can.
_MOMENT_SECONDS = 0.1


class Connections:
    """The connections of a server; each is there until its thread has ended."""

    def __init__(self) -> None:
        """Begin with none."""
        self._all: set[Connection] = set()
        # Those that were not sent away, with the address that each comes from.
        self._staying: dict[Connection, str] = {}
        self._of_address: Counter[str] = Counter()
        self._changed = threading.Condition()

    def __len__(self) -> int:
        return len(self._all)

    def add(self, connection: Connection, address: str) -> bool:
        """Take one in; return whether its address may have one more.

        For that its own connections leave, and nobody else's.

        Args:
            connection: the connection.
            address: its client's.
        """
        owner = _owner(address)
        with self._changed:
            if self._of_address[owner] >= MOST_OF_ONE_ADDRESS and not self._send_away(owner):
                return False
            self._all.add(connection)
            self._staying[connection] = owner
            self._of_address[owner] += 1
            return True

    def remove(self, connection: Connection) -> None:
        """Forget one, which has ended."""
        with self._changed:
            self._all.discard(connection)
            self._leaves(connection)
            self._changed.notify()

    def served_by(self, thread: int) -> list[Connection]:
        """Return those whose thread is this one."""
        with self._changed:
            return [one for one in self._all if one.thread == thread]

    def make_room(self) -> None:
        """Send some away, and wait a moment for them to leave."""
        with self._changed:
            self._send_away()
            self._changed.wait(_MOMENT_SECONDS)

    def _send_away(self, owner: str | None = None) -> int:
        """Send away whom nobody would miss soonest; return how many.

        They are sent away in the order of ``Connection.turn_to_leave()``; they may come again.

        Args:
            owner: whose connections; None for anybody's.
        """
        now = time.monotonic()
        turns = {
            one: turn
            for one, its_owner in self._staying.items()
            if owner in (None, its_owner) and (turn := one.turn_to_leave(now)) is not None
        }
        gone = 0
        for one in sorted(turns, key=turns.__getitem__):
            gone += self._sent_away(one)
            if gone == MAKES_ROOM:
                break
        return gone

    def _sent_away(self, connection: Connection) -> bool:
        gives_way = connection.give_way()
        if gives_way:
            self._leaves(connection)
        return gives_way

    def _leaves(self, connection: Connection) -> None:
        owner = self._staying.pop(connection, None)
        if owner is not None:
            self._of_address[owner] -= 1
            if not self._of_address[owner]:
                del self._of_address[owner]

    def shed_unsent(self) -> None:
        """Send away those who have not read for longest, while unread answers are too much."""
        now = time.monotonic()
        with self._changed:
            unread = [one for one in self._staying if one.unsent_bytes]
            excess = sum(one.unsent_bytes for one in unread) - MOST_UNSENT_BYTES
            for one in sorted(unread, key=lambda one: one.waiting_since):
                if excess <= 0 or one.turn_to_leave(now) is None:
                    break
                size = one.unsent_bytes
                if self._sent_away(one):
                    excess -= size

    def drain(self, grace: float, half_sent_seconds: float) -> bool:
        """Let all end that have nothing under way; return whether all have ended in time.

        Args:
            grace: seconds that requests under way may take.
            half_sent_seconds: after how many those are given up of which only a part has come.
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
    """Return what somebody's addresses have in common: in IPv6 a network has 2^64 of them."""
    ip = ipaddress.ip_address(address.partition("%")[0])
    if isinstance(ip, ipaddress.IPv6Address) and ip.ipv4_mapped is None:
        return str(ipaddress.ip_network((ip, 64), strict=False))
    return address
