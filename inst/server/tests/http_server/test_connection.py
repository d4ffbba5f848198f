"""The code of one connection, with short timeouts, and a client that behaves badly."""

import socket
import threading
import time
from contextlib import suppress

import pytest
from raw_http import read_all

from gym_server.http_server import connection as connection_module
from gym_server.http_server.connection import Connection
from gym_server.response import Admission, Response

pytestmark = pytest.mark.slow

GET = b"GET /%s HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
POST = b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: %d\r\n\r\n"
CHUNKED = b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n\r\n"
LARGE = 2**24


def echo(client, data):
    while data:
        client.sendall(data)
        data = client.recv(100)


class App:
    """Returns as many bytes as the path says, or the size of the body."""

    def __init__(self, knows=True, lasts=True):
        self.knows, self.lasts = knows, lasts
        self.admitted, self.bodies = [], []

    def admit(self, environ):
        path = environ["PATH_INFO"]
        self.admitted.append(path)
        if path == "/refused":
            return Response(403, b"no")

        def respond(body, is_connected):
            self.bodies.append(body)
            if environ.get("HTTP_UPGRADE") == "websocket" and path == "/echo":
                headers = (("Upgrade", "websocket"), ("Connection", "Upgrade"))
                return Response(101, b"", headers=headers, take_over=echo)
            return Response(200, bytes(int(path.strip("/") or 0)))

        return Admission(respond, self.knows, self.lasts)

    def refuse(self, status, reason):
        return Response(status, reason.encode())


@pytest.fixture
def converse(monkeypatch):
    """Return a function that connects a client to a new connection, and returns the thread."""
    monkeypatch.setattr(connection_module, "_UNKNOWN_SECONDS", 0.5)
    listener = socket.create_server(("127.0.0.1", 0))
    clients, threads = [], []

    def converse(app=None, most=2**20, seen=lambda connection: None):
        client = socket.socket()
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        client.settimeout(20)
        client.connect(listener.getsockname())
        accepted, _ = listener.accept()
        environ = {"wsgi.url_scheme": "http", "SERVER_NAME": "x"}
        connection = Connection(accepted, app or App(), environ, most)
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


# Known clients -------------------------------------------------------------------------------


def test_a_known_client_may_be_silent_for_long_and_as_slow_as_it_likes(converse):
    client, _ = converse()
    client.sendall(GET % b"")
    assert b"200 OK" in read_head(client)
    # Longer than an unknown client may take.
    time.sleep(1)
    for byte in POST % 10 + bytes(10):
        client.sendall(bytes([byte]))
        time.sleep(0.01)
    assert b"200 OK" in read_head(client)


def test_a_large_answer_arrives_in_full_however_slowly_it_is_read(converse):
    client, _ = converse()
    client.sendall(GET % b"%d" % 2**20)
    received = len(read_head(client))
    while received < 2**20:
        received += len(client.recv(65536))
        time.sleep(0.02)
    client.sendall(GET % b"")
    assert b"200 OK" in read_head(client)


def test_a_head_is_read_and_admitted_once(converse):
    app = App()
    client, _ = converse(app)
    for _ in range(2):
        for path in (b"1", b"2"):
            client.sendall(GET % path)
            read_head(client)
    assert app.admitted == ["/1", "/2"]


def test_a_head_whose_admission_does_not_last_is_admitted_each_time(converse):
    app = App(lasts=False)
    client, _ = converse(app)
    for _ in range(2):
        client.sendall(GET % b"1")
        read_head(client)
    assert app.admitted == ["/1", "/1"]


def test_heads_that_are_remembered_are_few(converse):
    connections = []
    client, _ = converse(seen=connections.append)
    for number in range(100):
        client.sendall(GET % b"%d" % number)
        read_head(client)
    client.sendall(GET.replace(b"Host", b"X: %b\r\nHost" % (b"y" * 5000)) % b"1")
    read_head(client)
    assert 0 < len(connections[0]._heads) <= connection_module._MOST_HEADS
    assert all(len(head) < 4096 for head in connections[0]._heads)


# Unknown clients -----------------------------------------------------------------------------


def test_an_unknown_client_gets_one_answer(converse):
    client, _ = converse(App(knows=False))
    client.sendall((GET % b"") * 2)
    answer = read_all(client)
    assert (answer.count(b"200 OK"), answer.count(b"Connection: close")) == (1, 1)


@pytest.mark.parametrize("begun", [b"", GET[:20], POST % 1000, CHUNKED + b"ff\r\n"])
def test_an_unknown_client_may_not_be_silent(converse, begun):
    client, _ = converse(App(knows=False))
    client.sendall(begun)
    assert client.recv(1) == b""


@pytest.mark.parametrize("app", [App(lasts=False), App(knows=False, lasts=False)])
@pytest.mark.parametrize("sent", [POST % 2**17, CHUNKED + b"20000\r\n"], ids=["whole", "chunked"])
def test_a_client_without_the_token_cannot_make_it_keep_a_large_body(converse, app, sent):
    client, _ = converse(app)
    client.sendall(sent)
    assert read_head(client).startswith(b"HTTP/1.1 413 ")


@pytest.mark.parametrize(
    ("begun", "drop"),
    [
        (b"", b"\r\n"),
        (b"GET / HTTP/1.1\r\nX: ", b"y"),
        (POST % 1000, b"y"),
        (CHUNKED + b"fff\r\n", b"y"),
        (GET % b"%d" % LARGE, b""),
        (GET % b"refused", b"y"),
    ],
    ids=["empty lines", "head", "body", "chunk", "reading", "refused"],
)
def test_an_unknown_client_gains_no_time_by_dripping(converse, begun, drop):
    client, thread = converse(App(knows=False))
    until = time.monotonic() + 10
    with suppress(OSError):
        client.sendall(begun)
        while thread.is_alive() and time.monotonic() < until:
            client.sendall(drop) if drop else client.recv(4096)
            thread.join(0.01)
    assert not thread.is_alive()


# Refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sent", "status"),
    [
        (GET % b"refused", b"403"),
        (b"GET /%b HTTP/1.1\r\n\r\n" % (b"x" * 70_000), b"400"),
        (b"GET / HTTP/1.1\r\nX: %b" % (b"x" * 70_000), b"400"),
        (POST % (2**20 + 1), b"413"),
        (CHUNKED + b"100001\r\n", b"413"),
        (CHUNKED + b"80000\r\n%b\r\n80001\r\n" % bytes(2**19), b"413"),
        (CHUNKED + b"1\r\nxyz", b"400"),
        (CHUNKED + b"x\r\n", b"400"),
        (CHUNKED + b"-1\r\n", b"400"),
        (CHUNKED + b"0\r\n" + b"a: b\r\n" * 200, b"400"),
        (CHUNKED + b"0\r\n" + b"a" * 70_000, b"400"),
    ],
    ids=lambda value: repr(value)[:40],
)
def test_a_refusal_is_seen_by_a_client_that_goes_on_sending(converse, sent, status):
    app = App()
    client, _ = converse(app)
    client.sendall(sent + b"GET / HTTP/1.1\r\n\r\n" * 100_000)
    client.shutdown(socket.SHUT_WR)
    answer = read_all(client)
    assert answer.startswith(b"HTTP/1.1 %b " % status) and b"Connection: close" in answer
    assert answer.count(b"HTTP/1.1") == 1
    assert app.bodies == []


def test_a_refused_client_that_stays_is_sent_away(converse, monkeypatch):
    monkeypatch.setattr(connection_module, "_DISCARD_SECONDS", 0.2)
    client, thread = converse()
    client.sendall(GET % b"refused")
    thread.join(10)
    assert not thread.is_alive()
    assert b"403" in read_all(client)


def test_a_refusal_of_a_head_request_has_no_body(converse):
    client, _ = converse()
    client.sendall((GET % b"refused").replace(b"GET", b"HEAD"))
    client.shutdown(socket.SHUT_WR)
    answer = read_all(client)
    assert b"Content-Length: 2\r\n" in answer and answer.endswith(b"\r\n\r\n")


# Bodies --------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1, 5, 10**9])
def test_a_body_is_the_same_in_however_many_pieces_it_comes(converse, size):
    app = App()
    client, _ = converse(app)
    chunks = b"2\r\nab\r\n003;x=y\r\ncde\r\n0\r\nTrailer: x\r\n\r\n"
    sent = POST % 5 + b"abcde" + CHUNKED + chunks + b"\r\n\r\n" + POST % 0 + POST % 5 + b"abcde"
    for begin in range(0, len(sent), size):
        client.sendall(sent[begin : begin + size])
    answers = b""
    while answers.count(b"200 OK") < 4:
        answers += client.recv(65536)
    assert app.bodies == [b"abcde", b"abcde", b"", b"abcde"]


def test_a_body_in_tiny_chunks_is_read_soon(converse):
    app = App()
    client, _ = converse(app)
    client.sendall(CHUNKED + b"2\r\nab\r\n" * 2**17 + b"0\r\n\r\n")
    read_head(client)
    assert app.bodies == [b"ab" * 2**17]


def test_a_client_that_asks_before_it_sends_is_told_to_each_time(converse):
    client, _ = converse()
    for _ in range(2):
        client.sendall((POST % 2).replace(b"Host", b"Expect: 100-Continue\r\nHost"))
        assert read_head(client) == b"HTTP/1.1 100 Continue\r\n\r\n"
        client.sendall(b"{}")
        assert read_head(client).startswith(b"HTTP/1.1 200")


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
    client.sendall(WEBSOCKET % b"/3" + GET % b"")
    answers = b""
    while answers.count(b"HTTP/1.1 200 ") < 2:
        answers += client.recv(65536)
