"""Which connections are evicted when more clients come."""

import math

import pytest

from gym_server.http_server import connections as module
from gym_server.http_server.connections import Connections


class Fake:
    """Imitates a connection."""

    thread = 0

    def __init__(self, rank, unsent_bytes=0):
        self.rank, self.unsent_bytes = rank, unsent_bytes
        self.waiting_since = math.inf if rank is None else rank[1]
        self.is_evicted = False

    def eviction_rank(self, now):
        return self.rank

    def evict(self):
        self.is_evicted = self.rank is not None
        return self.is_evicted


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(module, "MOST_CONNECTIONS", 8)
    monkeypatch.setattr(module, "MOST_OF_ONE_ADDRESS", 4)
    monkeypatch.setattr(module, "EVICTED_AT_ONCE", 2)
    return Connections()


def filled(connections, address, ranks):
    fakes = [Fake(rank) for rank in ranks]
    assert all(connections.add(fake, address) for fake in fakes)
    return fakes


def test_those_of_the_lowest_rank_are_evicted_first(few):
    fakes = filled(few, "10.0.0.1", [(2, 1.0), None, (0, 9.0)])
    fakes += filled(few, "10.0.0.2", [(1, 5.0)])
    few.make_room()
    assert [fake.is_evicted for fake in fakes] == [False, False, True, True]
    assert len(few) == 4
    few.make_room()
    assert [fake.is_evicted for fake in fakes] == [True, False, True, True]


def test_an_address_makes_room_for_its_own(few):
    others = filled(few, "10.0.0.2", [(0, 0.0)] * 3)
    fakes = filled(few, "10.0.0.1", [(2, 4.0), (2, 1.0), (2, 2.0), None])
    assert few.add(Fake(None), "10.0.0.1")
    assert [fake.is_evicted for fake in fakes] == [False, True, True, False]
    assert not any(fake.is_evicted for fake in others)


def test_an_address_whose_connections_are_all_at_work_gets_no_more(few):
    fakes = filled(few, "10.0.0.1", [None] * 4)
    assert not few.add(Fake(None), "10.0.0.1")
    assert few.add(Fake(None), "10.0.0.2")
    few.remove(fakes[0])
    assert few.add(Fake(None), "10.0.0.1")


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("2001:db8::1", "2001:db8::ffff:1", True),
        ("2001:db8::1", "2001:db8:0:1::1", False),
        ("fe80::1%eth0", "fe80::2", True),
        ("::ffff:10.0.0.1", "::ffff:10.0.0.2", False),
    ],
)
def test_a_network_of_one_owner_is_one_address(few, one, other, same):
    filled(few, one, [None] * 4)
    assert few.add(Fake(None), other) is not same


def test_answers_that_are_not_read_do_not_pile_up(few, monkeypatch):
    monkeypatch.setattr(module, "MOST_UNSENT_BYTES", 100)
    sizes = {5.0: 60, 1.0: 60, 3.0: 60, 9.0: 0}
    fakes = [Fake((1, since), size) for since, size in sizes.items()]
    for number, fake in enumerate(fakes):
        few.add(fake, f"10.0.0.{number}")
    few.evict_unread()
    assert [fake.is_evicted for fake in fakes] == [False, True, True, False]
