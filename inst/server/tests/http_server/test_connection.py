"""The code of one connection, with short timeouts, and a client that behaves badly."""

import gc
import socket
import threading
import time
import weakref
from contextlib import suppress

import pytest

from gym_server.budget import Budget
from gym_server.http_server import connection as connection_module
from gym_server.http_server.connection import Connection
from gym_server.response import Response

pytestmark = pytest.mark.slow

GET = b"GET /%s HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
POST = b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: %d\r\n\r\n"
LARGE = 2**24
ROOM = 2**18


def echo(client, data):
    while data:
        client.sendall(data)
        data = client.recv(100)


class App:
    """Returns as many bytes as the path says."""

    def __init__(self, recognizes):
        self.recognizes = recognizes

    def respond(self, environ):
        environ["wsgi.input"].read()
        if environ.get("HTTP_UPGRADE") == "websocket" and environ["PATH_INFO"] == "/echo":
            headers = (("Upgrade", "websocket"), ("Connection", "Upgrade"))
            return Response(101, b"", headers=headers, take_over=echo)
        return Response(200, bytes(int(environ["PATH_INFO"].strip("/") or 0)))

    def admit(self, environ):
        return None

    def refuse(self, status, reason):
        return Response(status, reason.encode(), headers=(("Retry-After", "5"),))


@pytest.fixture
def short_timeouts(monkeypatch):
    monkeypatch.setattr(connection_module, "_REST_SECONDS", 0.5)
    monkeypatch.setattr(connection_module, "_UNRECOGNIZED_SECONDS", 0.5)
    monkeypatch.setattr(connection_module, "_SLOWEST_BYTES", 2**20)


@pytest.fixture
def converse(short_timeouts):
    """Return a function that connects a client to a new connection, and returns the thread."""
    listener = socket.create_server(("127.0.0.1", 0))
    clients, threads = [], []

    def converse(
        budget=None, most=2**20, seen=lambda connection: None, recognizes=lambda environ: True
    ):
        client = socket.socket()
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        client.settimeout(20)
        client.connect(listener.getsockname())
        accepted, _ = listener.accept()
        environ = {"wsgi.url_scheme": "http", "SERVER_NAME": "x"}
        bodies = (budget or Budget(ROOM)).share()
        connection = Connection(accepted, App(recognizes), environ, most, bodies)
        seen(connection)
        thread = threading.Thread(target=connection.serve)
        thread.start()
        clients.append(client)
        threads.append(thread)
        return client, thread

    yield converse
    for client in clients:
        client.close()
    for thread in threads:
        thread.join(10)
        assert not thread.is_alive()
    listener.close()


def read_head(client):
    data = b""
    while b"\r\n\r\n" not in data:
        more = client.recv(65536)
        assert more, "closed without an answer"
        data += more
    return data


# Answers that are not read -------------------------------------------------------------------


@pytest.mark.parametrize("asked", [1, 50])
def test_an_answer_that_is_not_read_ends_the_connection(converse, asked):
    client, thread = converse()
    client.sendall(GET % b"%d" % LARGE * asked)
    thread.join(20)
    assert not thread.is_alive()


def test_an_answer_that_is_read_drop_by_drop_ends_the_connection(converse):
    client, thread = converse()
    client.sendall(GET % b"%d" % LARGE)
    received = 0
    with suppress(ConnectionError):
        while thread.is_alive() and received < 2**21:
            # Never idle for the longest allowed time, but too slow.
            received += len(client.recv(4096))
            thread.join(0.01)
    assert received < 2**21


def test_an_answer_that_is_read_steadily_arrives_in_full(converse):
    client, _ = converse()
    client.sendall(GET % b"%d" % 2**21)
    began, received = time.monotonic(), len(read_head(client))
    while received < 2**21:
        # Twice as fast as required, for longer than the longest allowed pause.
        time.sleep(max(0, began + received / 2**21 - time.monotonic()))
        received += len(client.recv(65536))
    client.sendall(GET % b"")
    assert b"200 OK" in read_head(client)


def test_a_client_that_is_recognized_may_be_silent_for_long(converse):
    client, _ = converse()
    client.sendall(GET % b"")
    assert b"200 OK" in read_head(client)
    # Longer than a pause may be while it sends or reads.
    time.sleep(1)
    client.sendall(GET % b"")
    assert b"200 OK" in read_head(client)


# Other protocols -----------------------------------------------------------------------------

WEBSOCKET = b"GET %s HTTP/1.1\r\nHost: a\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\r\n"


def test_a_route_may_take_over_the_socket(converse):
    client, thread = converse()
    client.sendall(WEBSOCKET % b"/echo" + b"ab")
    head = read_head(client)
    while not head.endswith(b"ab"):
        head += client.recv(100)
    assert head.startswith(b"HTTP/1.1 101 ")
    assert b"Content-" not in head and b"close" not in head
    client.sendall(b"cd")
    assert client.recv(100) == b"cd"
    client.shutdown(socket.SHUT_WR)
    assert client.recv(100) == b""
    thread.join(10)


def test_a_stop_ends_what_a_socket_that_was_taken_over_receives(converse):
    connections = []
    client, thread = converse(seen=connections.append)
    client.sendall(WEBSOCKET % b"/echo" + b"ab")
    while b"ab" not in client.recv(100):
        pass
    connections[0].stop(half_sent=False)
    thread.join(10)
    assert not thread.is_alive()


def test_a_websocket_that_is_declined_is_answered_as_any_request(converse):
    client, _ = converse()
    client.sendall(WEBSOCKET % b"/3")
    assert read_head(client).startswith(b"HTTP/1.1 200 ")


# Clients that are not recognized -------------------------------------------------------------


def recognizes_nobody(environ):
    return False


def test_an_unrecognized_client_gets_one_answer(converse):
    client, _ = converse(recognizes=recognizes_nobody)
    client.sendall((GET % b"") * 2)
    answer = b""
    while more := client.recv(65536):
        answer += more
    assert (answer.count(b"200 OK"), answer.count(b"Connection: close")) == (1, 1)


@pytest.mark.parametrize("begun", [b"", GET[:20], POST % 1000])
def test_an_unrecognized_client_may_not_be_silent(converse, begun):
    client, _ = converse(recognizes=recognizes_nobody)
    client.sendall(begun)
    assert client.recv(1) == b""


@pytest.mark.parametrize(
    ("begun", "drop"),
    [
        (b"", b"\r\n"),
        (b"GET / HTTP/1.1\r\nX: ", b"y"),
        (POST % 1000, b"y"),
        (POST % LARGE, b"y"),
        (GET % b"%d" % LARGE, b""),
    ],
    ids=["empty lines", "head", "body", "large body", "reading"],
)
def test_a_client_that_is_not_recognized_gains_no_time_by_dripping(
    converse, monkeypatch, begun, drop
):
    # Each byte gains a second for a recognized client.
    monkeypatch.setattr(connection_module, "_SLOWEST_BYTES", 1)
    client, thread = converse(most=2 * LARGE, recognizes=recognizes_nobody)
    until = time.monotonic() + 1.5
    with suppress(OSError):
        client.sendall(begun)
        while thread.is_alive() and time.monotonic() < until:
            client.sendall(drop) if drop else client.recv(4096)
            thread.join(0.01)
    assert not thread.is_alive()


def test_it_is_asked_about_a_client_until_that_is_recognized(converse):
    asked = []
    client, _ = converse(recognizes=lambda environ: asked.append(environ["PATH_INFO"]) or True)
    for path in (b"1", b"2"):
        client.sendall(GET % path)
        read_head(client)
    assert asked == ["/1"]


# Bodies --------------------------------------------------------------------------------------


def test_a_body_for_which_there_is_no_room_is_503(converse):
    client, _ = converse()
    client.sendall(POST % (2 * ROOM) + bytes(2 * ROOM))
    answer = read_head(client)
    assert answer.startswith(b"HTTP/1.1 503 ")
    assert b"\r\nRetry-After: " in answer
    client.sendall(GET % b"")
    assert b"200 OK" in read_head(client)


@pytest.mark.parametrize("sent", [ROOM, ROOM - 1], ids=["answered", "half-sent"])
def test_the_room_of_a_body_is_given_back(converse, sent):
    budget = Budget(ROOM)
    client, thread = converse(budget)
    client.sendall(POST % ROOM + bytes(sent))
    if sent == ROOM:
        read_head(client)
    else:
        client.close()
        thread.join(10)
    assert budget.share().take(ROOM)


def test_what_was_half_sent_leaves_nothing_for_the_garbage_collection(converse):
    readers = []
    gc.collect()
    gc.disable()
    try:
        client, thread = converse(
            seen=lambda connection: readers.append(weakref.ref(connection._parser))
        )
        client.sendall(POST % ROOM + bytes(ROOM - 1))
        client.close()
        thread.join(10)
        del thread
        assert readers[0]() is None
    finally:
        gc.enable()
