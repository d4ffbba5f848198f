"""More connections than a server allows."""

import json
import socket
import threading
import time

import pytest

from gym_server.api.app import create_app
from gym_server.budget import Budget
from gym_server.http_server import connections as connections_module
from gym_server.http_server.server import Server, bind

pytestmark = pytest.mark.slow

GET = b"GET /v1/health/ HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
LARGE = b"GET /v1/registry/ HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
MOST = 10


@pytest.fixture
def crowded(monkeypatch):
    """Run a server that allows few connections; return a function that opens one."""
    monkeypatch.setattr(connections_module, "MOST_CONNECTIONS", MOST)
    monkeypatch.setattr(connections_module, "MOST_OF_ONE_ADDRESS", MOST)
    monkeypatch.setattr(connections_module, "EVICTED_AT_ONCE", 2)
    # On a busy machine, evicted connections take longer to end, and more would be evicted.
    monkeypatch.setattr(connections_module, "_MOMENT_SECONDS", 5)
    app = create_app()
    server = Server(app, bind("127.0.0.1", 0), 2**20, Budget(2**24))
    running = threading.Thread(target=server.run, args=(5,))
    running.start()
    connections = []

    def connect():
        connection = socket.socket()
        # A small buffer: a client that does not read soon has too much unread.
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        connection.settimeout(20)
        connection.connect(("127.0.0.1", server.port))
        connections.append(connection)
        return connection

    def of_rank(kind):
        """Count the connections with this kind of rank."""
        now = [one.eviction_rank(time.monotonic()) for one in list(server._connections._all)]
        return sum(rank is not None and rank[0] == kind for rank in now)

    connect.of_rank = of_rank
    yield connect
    for connection in connections:
        connection.close()
    server.stop()
    running.join(20)
    app.close()


def is_well(connection):
    connection.sendall(GET)
    answer = b""
    while b"\r\n\r\n" not in answer or not answer.endswith(b"}"):
        more = connection.recv(65536)
        assert more, "it was sent away"
        answer += more
    return json.loads(answer.partition(b"\r\n\r\n")[2])["status"] == "ok"


def test_silent_connections_leave_for_new_ones(crowded):
    silent = [crowded() for _ in range(MOST)]
    assert all(is_well(connection) for connection in silent)
    assert is_well(silent[0])
    assert all(is_well(crowded()) for _ in range(2))
    # The longest silent connection was evicted; the one that asked last stays.
    assert silent[1].recv(1) == b""
    assert is_well(silent[0])


def test_half_sent_requests_leave_as_well(crowded):
    for _ in range(MOST):
        crowded().sendall(GET[:20])
    assert is_well(crowded())


def test_connections_whose_answer_is_not_read_are_evicted_before_silent_ones(crowded, eventually):
    silent = crowded()
    assert is_well(silent)
    for _ in range(MOST - 1):
        crowded().sendall(LARGE * 200)
    eventually(lambda: crowded.of_rank(1) == MOST - 1)
    assert all(is_well(crowded()) for _ in range(MOST // 2))
    assert is_well(silent)


def test_connections_whose_client_is_not_recognized_are_evicted_first(crowded, eventually):
    silent = crowded()
    assert is_well(silent)
    for _ in range(MOST - 1):
        crowded().sendall(GET[:20])
    eventually(lambda: crowded.of_rank(0) == MOST - 1)
    assert all(is_well(crowded()) for _ in range(MOST // 2))
    assert is_well(silent)


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
