import selectors
import socket

import pytest

from gym_server.front.relay import Relay


class Joined:
    """A client and a server, passed on by a relay; ``turn()`` is one turn of the loop."""

    def __init__(self, request=b"hello"):
        self.selector = selectors.DefaultSelector()
        self.client, near_client = socket.socketpair()
        self.server, near_server = socket.socketpair()
        self.near = near_client, near_server
        for one in (self.client, self.server, *self.near):
            one.setblocking(False)
        self.events = []
        self.relay = Relay(
            self.selector,
            *self.near,
            request,
            lambda: self.events.append("ended"),
            lambda: self.events.append("refused"),
        )

    def turn(self, times=5):
        for _ in range(times):
            for key, events in self.selector.select(0):
                key.data(events)

    def close(self):
        for one in (self.client, self.server, *self.near):
            one.close()
        self.selector.close()


@pytest.fixture
def joined():
    joined = Joined()
    joined.turn()
    assert joined.server.recv(100) == b"hello"
    yield joined
    joined.close()


def filled(sender, joined):
    """Send until nothing more is taken; return how much was."""
    total = 0
    for _ in range(10_000):
        try:
            total += sender.send(b"x" * 65536)
        except BlockingIOError:
            before = total
            joined.turn()
            try:
                total += sender.send(b"x" * 65536)
            except BlockingIOError:
                return before
    raise AssertionError("it takes everything")


def test_bytes_pass_both_ways_and_say_who_waits(joined):
    assert joined.relay.is_busy
    joined.server.send(b"answer")
    joined.turn()
    assert joined.client.recv(100) == b"answer" and not joined.relay.is_busy
    joined.client.send(b"more")
    joined.turn()
    assert joined.server.recv(100) == b"more" and joined.relay.is_busy


@pytest.mark.parametrize("sender", ["client", "server"])
def test_for_a_reader_that_is_slow_nothing_more_is_read_and_nothing_is_lost(joined, sender):
    sender, reader = (
        (joined.client, joined.server) if sender == "client" else (joined.server, joined.client)
    )
    total = filled(sender, joined)
    # The loop has nothing to do meanwhile.
    assert joined.selector.select(0) == []
    received = 0
    while received < total:
        joined.turn(1)
        try:
            received += len(reader.recv(2**20))
        except BlockingIOError:
            continue
    joined.turn()
    with pytest.raises(BlockingIOError):
        reader.recv(1)
    # Afterwards the connection is as before.
    sender.send(b"last")
    joined.turn()
    assert reader.recv(100) == b"last"


def test_a_client_that_sends_no_more_still_gets_its_answer(joined):
    joined.client.shutdown(socket.SHUT_WR)
    joined.turn()
    assert joined.server.recv(100) == b""
    joined.server.send(b"answer")
    joined.server.close()
    joined.turn()
    assert joined.client.recv(100) == b"answer"
    assert joined.client.recv(100) == b""
    assert joined.events == ["ended"] and not joined.selector.get_map()


def test_the_rest_of_a_long_answer_arrives_after_the_server_has_closed(joined):
    total = filled(joined.server, joined)
    joined.server.close()
    received = 0
    while "ended" not in joined.events or received < total:
        joined.turn(1)
        try:
            data = joined.client.recv(2**20)
        except BlockingIOError:
            continue
        if not data:
            break
        received += len(data)
    assert received == total


def test_a_connection_that_the_server_refuses_is_given_back():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    joined = Joined()
    joined.relay.close()
    client, near = socket.socketpair()
    server = socket.socket()
    server.setblocking(False)
    server.connect_ex(("127.0.0.1", port))
    events = []
    Relay(
        joined.selector,
        near,
        server,
        b"x",
        lambda: events.append("ended"),
        lambda: events.append("refused"),
    )
    joined.turn()
    assert events == ["refused"] and near.fileno() >= 0 and server.fileno() < 0
    assert not joined.selector.get_map()
    client.close()
    near.close()
    joined.close()
