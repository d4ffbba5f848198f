"""More connections than a server allows."""

import json
import socket
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import pytest

from gym_server.api.app import create_app
from gym_server.http_server import server as server_module
from gym_server.http_server.server import Server, bind

pytestmark = pytest.mark.slow

GET = b"GET /v1/health/ HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
POST = b"POST /v1/envs/ HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 9\r\n\r\n{"
MOST = 10


@pytest.fixture
def crowded(monkeypatch):
    """Run a server that allows few connections; return a function that opens one."""
    monkeypatch.setattr(server_module, "_MOST_CONNECTIONS", MOST)
    monkeypatch.setattr(server_module, "_ENDED_AT_ONCE", 1)
    # On a busy machine, a dropped connection takes longer to end, and more would be dropped.
    monkeypatch.setattr(server_module, "_MOMENT_SECONDS", 5)
    app = create_app()
    server = Server(app, bind("127.0.0.1", 0), 2**20)
    running = threading.Thread(target=server.run, args=(5,))
    running.start()
    connections = []

    def connect():
        connections.append(socket.create_connection(("127.0.0.1", server.port), timeout=20))
        return connections[-1]

    def silent():
        """Return how many connections wait for a request, once all are there and answered."""
        ranks = [one.rank for one in list(server._connections)]
        return len(ranks) == MOST and None not in ranks and sum(rank[1] for rank in ranks)

    connect.silent = silent
    yield connect
    for connection in connections:
        connection.close()
    server.stop()
    running.join(20)
    app.close()


def is_well(connection, sent=False):
    if not sent:
        connection.sendall(GET)
    answer = b""
    while b"\r\n\r\n" not in answer or not answer.endswith(b"}"):
        more = connection.recv(65536)
        assert more, "it was dropped"
        answer += more
    return json.loads(answer.partition(b"\r\n\r\n")[2])["status"] == "ok"


@pytest.mark.parametrize("begun", [b"", GET[:20]], ids=["silent", "half-sent"])
def test_the_oldest_of_unknown_clients_leaves_for_a_new_one(crowded, begun, eventually):
    known = [crowded(), crowded()]
    assert all(is_well(connection) for connection in known)
    unknown = [crowded() for _ in range(MOST - 2)]
    eventually(lambda: crowded.silent() == MOST)
    for left, connection in enumerate(unknown, 1):
        connection.sendall(begun)
        # One after another: the oldest is the one whose request the server has heard first.
        eventually(lambda left=left: crowded.silent() == (MOST - left if begun else MOST))
    new = [crowded(), crowded()]
    assert all(is_well(connection) for connection in (*new, *known))
    assert [connection.recv(1) for connection in unknown[:2]] == [b"", b""]
    for connection in unknown[2:]:
        connection.sendall(GET[len(begun) :])
        assert is_well(connection, sent=True)


def test_half_of_a_request_leaves_before_a_silent_client_that_is_known(crowded, eventually):
    silent = crowded()
    half = [crowded() for _ in range(MOST - 1)]
    assert all(is_well(connection) for connection in (silent, *half))
    for connection in half:
        connection.sendall(POST)
    # The server has read what came, so that it knows who is silent.
    eventually(lambda: crowded.silent() == 1)
    assert all(is_well(crowded()) for _ in range(3))
    assert is_well(silent)


def test_if_all_are_known_the_one_leaves_that_was_silent_for_longest(crowded):
    known = [crowded() for _ in range(MOST)]
    assert all(is_well(connection) for connection in (*known, known[0]))
    assert is_well(crowded())
    assert known[1].recv(1) == b""
    assert all(is_well(connection) for connection in (known[0], *known[2:]))


def send_without_reading(connection):
    """Send requests until the server, whose answers nobody reads, has taken none for a while."""
    connection.settimeout(2)
    with suppress(TimeoutError):
        while True:
            connection.send(GET * 1000)


def test_a_new_client_waits_while_all_are_at_work(crowded, monkeypatch):
    monkeypatch.setattr(server_module, "_MOMENT_SECONDS", 0.1)
    known = [crowded() for _ in range(MOST)]
    with ThreadPoolExecutor(MOST) as pool:
        list(pool.map(send_without_reading, known))
    new = crowded()
    new.sendall(GET)
    new.settimeout(0.5)
    with pytest.raises(TimeoutError):
        new.recv(1)
    known[0].close()
    new.settimeout(20)
    assert is_well(new, sent=True)


def test_a_server_without_threads_turns_one_away_and_goes_on(crowded, monkeypatch):
    start, refused = threading.Thread.start, []

    def refuse_the_first(thread):
        if not refused:
            refused.append(thread)
            raise RuntimeError("can't start new thread")
        start(thread)

    monkeypatch.setattr(threading.Thread, "start", refuse_the_first)
    assert crowded().recv(1) == b""
    assert is_well(crowded())
