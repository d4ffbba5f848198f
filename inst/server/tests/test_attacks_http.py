"""Attacks on a real server by the way that requests are sent; all must fail."""

import http.client
import json
import os
import socket
import threading
import time
from contextlib import closing, suppress

import pytest
from conftest import TOKEN
from raw_http import read_all

from gym_server.api.access import Access
from gym_server.api.app import Config, create_app
from gym_server.http_server import connection as connection_module
from gym_server.http_server.connection import Connection

pytestmark = pytest.mark.slow

# Heads ---------------------------------------------------------------------------------------


def talk(server, sent, seconds=10):
    """Send bytes, and return everything that the server sends back."""
    with server.socket() as connection:
        connection.settimeout(seconds)
        with suppress(OSError):
            connection.sendall(sent)
            connection.shutdown(socket.SHUT_WR)
        return read_all(connection)


def statuses(received):
    return [
        int(part.split(b" ", 1)[0])
        for part in received.split(b"HTTP/1.1 ")[1:]
        if part[:3].isdigit()
    ]


AUTHORIZED = f"Host: 127.0.0.1\r\nAuthorization: Bearer {TOKEN}\r\n".encode()
GET = b"GET /v1/health/ HTTP/1.1\r\n" + AUTHORIZED
POST = b"POST /v1/envs/ HTTP/1.1\r\n" + AUTHORIZED
# If the server took this for a request, it would answer 410.
HIDDEN = (
    b'POST /v1/upload/ HTTP/1.1\r\n%bContent-Length: 35\r\n\r\n{"training_dir":"a","api_key":"bcd"}'
)
HIDDEN %= AUTHORIZED


@pytest.mark.parametrize(
    "more",
    [
        b"".join(b"X-%d: y\r\n" % number for number in range(20_000)),
        b"X: y\r\n" * 40_000,
        b"X: " + b"y" * 10**6 + b"\r\n",
        b"X" * 10**6 + b": y\r\n",
        b"Cookie: " + b"a=b; " * 40_000 + b"\r\n",
    ],
    ids=["many", "same", "long", "long name", "cookies"],
)
def test_a_head_beyond_all_measure_is_refused(ask, attacked, more):
    assert statuses(talk(attacked, GET + more + b"\r\n"))[:1] in ([400], [])


def test_a_long_url_and_many_headers_are_none_of_its_concerns(ask, attacked):
    assert statuses(talk(attacked, GET + b"X: y\r\n" * 98 + b"\r\n")) == [200]
    url = b"/v1/health/?" + b"a=b&" * 10_000
    assert statuses(talk(attacked, GET.replace(b"/v1/health/", url) + b"\r\n")) == [200]


@pytest.mark.parametrize(
    "headers",
    [
        b"Content-Length: 0\r\nContent-Length: %d\r\n",
        b"Content-Length: %d\r\nContent-Length: 0\r\n",
        b"Content-Length: 0, %d\r\n",
        b"Content-Length: 0\r\nTransfer-Encoding: chunked\r\n",
        b"Transfer-Encoding: chunked\r\nContent-Length: %d\r\n",
        b"Transfer-Encoding: chunked\r\nTransfer-Encoding: identity\r\n",
        b"Transfer-Encoding: identity\r\nTransfer-Encoding: chunked\r\n",
        b"Transfer-Encoding: xchunked\r\n",
        b"Transfer-Encoding: chunked, identity\r\n",
        b"Transfer-Encoding : chunked\r\n",
        b"Transfer-Encoding:\r\n chunked\r\n",
        b"Transfer-Encoding: \x0bchunked\r\n",
        b"Content-Length: +0\r\n",
        b"Content-Length: -1\r\n",
        b"Content-Length: 0x0\r\n",
        b"Content-Length: 0_0\r\n",
        b"Content-Length : 0\r\n",
        b"Content-Length: 18446744073709551616\r\n",
        b"X: y\nContent-Length: 0\r\n",
        b"X: y\rContent-Length: 0\r\n",
        b"X: \0\r\n",
        b" Content-Length: 0\r\n",
    ],
    ids=lambda headers: repr(headers)[2:60],
)
def test_where_a_request_ends_is_never_in_doubt(ask, attacked, headers):
    """A request that proxies may split in different ways is answered by 400."""
    filled = headers.replace(b"%d", b"%d" % len(b"0\r\n\r\n" + HIDDEN))
    for body in (b"0\r\n\r\n" + HIDDEN, HIDDEN):
        got = statuses(talk(attacked, POST + filled + b"\r\n" + body))
        assert got == [400], got


@pytest.mark.parametrize(
    "body",
    [
        b"-1\r\n",
        b"+1\r\nx\r\n0\r\n\r\n",
        b"0x1\r\nx\r\n0\r\n\r\n",
        b"1\nx\n0\n\n",
        b"1\r\nxy0\r\n\r\n",
        b"ffffffffffffffff1\r\n",
        b"ffffffffffffffff\r\n",
        b"1 \r\nx\r\n0\r\n\r\n",
        b"g\r\n",
        b"\r\n",
    ],
    ids=repr,
)
def test_a_chunk_that_is_none_ends_the_conversation(ask, attacked, body):
    sent = POST + b"Transfer-Encoding: chunked\r\n\r\n" + body + HIDDEN
    assert set(statuses(talk(attacked, sent))) <= {400, 413}


def test_a_request_needs_one_host(ask, attacked):
    for host in (b"", b"Host: a\r\nHost: 127.0.0.1\r\n"):
        sent = b"GET /v1/health/ HTTP/1.1\r\n" + host + b"Connection: close\r\n\r\n"
        assert statuses(talk(attacked, sent)) == [400]
    sent = b"GET http://127.0.0.1/v1/health/ HTTP/1.1\r\nHost: evil.example\r\n\r\n"
    assert statuses(talk(attacked, sent)) == [403]


def test_a_header_cannot_be_brought_in_by_a_url(ask, attacked):
    for path in ("/v1/envs/%0d%0aX-Evil:%20yes/", "/v1/registry/?search=%0d%0aX-Evil:%20yes"):
        received = talk(attacked, GET.replace(b"/v1/health/", path.encode()) + b"\r\n")
        head = received.split(b"\r\n\r\n")[0]
        assert b"\r\nX-Evil" not in head


def test_who_has_no_token_cannot_make_it_keep_a_large_body(ask, attacked):
    """The body is discarded as it arrives, once the missing token is noticed."""
    pid = attacked.process.pid
    large = 12 * 2**20
    head = b"POST /v1/envs/ HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: %d\r\n\r\n" % large
    before = resident(pid)
    connections = [attacked.socket() for _ in range(10)]
    for connection in connections:
        # All but the last byte.
        connection.sendall(head + b" " * (large - 1))
    time.sleep(0.3)
    assert resident(pid) - before < 60 * 2**20
    for connection in connections:
        connection.sendall(b" ")
        answer = connection.recv(65536)
        assert answer.startswith(b"HTTP/1.1 401")
        assert b"WWW-Authenticate: Bearer" in answer
        connection.close()


def resident(pid):
    if not os.path.exists("/proc/self/status"):
        return 0
    with open(f"/proc/{pid}/status") as status:
        line = next(line for line in status if line.startswith("VmRSS"))
    return int(line.split()[1]) * 1024


def test_who_has_no_token_and_asks_first_is_refused_first(ask, attacked):
    head = b"POST /v1/envs/ HTTP/1.1\r\nHost: 127.0.0.1\r\nExpect: 100-continue\r\n"
    assert statuses(talk(attacked, head + b"Content-Length: 1000000\r\n\r\n")) == [401]


# Drop by drop --------------------------------------------------------------------------------


@pytest.fixture
def conversation(monkeypatch):
    """Talk to the code of one connection, with short timeouts."""
    monkeypatch.setattr(connection_module, "_UNKNOWN_SECONDS", 0.5)
    ours, theirs = socket.socketpair()
    listener = socket.create_server(("127.0.0.1", 0))
    ours.close()
    theirs.close()
    client = socket.create_connection(listener.getsockname())
    accepted, _ = listener.accept()
    app = create_app(Config(access=Access(TOKEN)))
    environ = {"wsgi.url_scheme": "http", "SERVER_NAME": "x"}
    served = Connection(accepted, app, environ, 2**20)
    thread = threading.Thread(target=served.serve)
    thread.start()
    yield client
    client.close()
    thread.join(10)
    listener.close()
    app.close()
    assert not thread.is_alive()


@pytest.mark.parametrize(
    "begun",
    [
        b"GET /v1/health/ HTTP/1.1\r\nHost: 127.0.0.1\r\nX: ",
        b"POST /v1/envs/ HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 100000\r\n\r\n",
        b"POST /v1/envs/ HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n\r\nffff\r\n",
    ],
    ids=["head", "body", "chunks"],
)
def test_a_request_without_the_token_drop_by_drop_ends_the_connection(conversation, begun):
    began = time.monotonic()
    conversation.settimeout(0.05)
    # Never silent for as long as its timeout.
    with suppress(ConnectionError):
        conversation.sendall(begun)
        while time.monotonic() - began < 20:
            conversation.sendall(b" ")
            with suppress(TimeoutError):
                if not conversation.recv(100):
                    break
    assert time.monotonic() - began < 15


def test_slow_clients_hold_nobody_up(ask, attacked):
    slow = [attacked.socket() for _ in range(100)]
    for connection in slow:
        connection.sendall(b"GET /v1/health/ HTTP/1.1\r\nHost: 127.0.0.1\r\nX: ")
    for _ in range(5):
        for connection in slow:
            connection.sendall(b"y")
        began = time.monotonic()
        assert ask("GET", "/v1/health/")[0] == 200
        assert time.monotonic() - began < 5
    for connection in slow:
        connection.close()


# The token -----------------------------------------------------------------------------------


def test_the_token_is_in_no_answer_and_no_log(serve):
    server = serve(GYM_SERVER_TOKEN=TOKEN)
    answers = []
    for path in ("/v1/health/", "/nowhere", "/v1/envs/00000000/", "/v1/registry/"):
        for headers in ({}, {"Authorization": f"Bearer {TOKEN}"}, {"Authorization": TOKEN}):
            with closing(server.connect()) as connection:
                connection.request("GET", path, headers=headers)
                answer = connection.getresponse()
                answers.append(str(answer.headers) + answer.read().decode())
    with closing(http.client.HTTPConnection("127.0.0.1", server.port)) as connection:
        connection.request(
            "POST",
            "/v1/envs/",
            json.dumps({"env_id": "faulty_envs:Variables-v0"}),
            {"Authorization": f"Bearer {TOKEN}"},
        )
        answers.append(connection.getresponse().read().decode())
    _, output, errors = server.stop() if os.name == "posix" else (0, "", "")
    assert not any(TOKEN in text for text in (*answers, output, errors))
    assert "127.0.0.1 sent requests without a token" in errors or os.name != "posix"
