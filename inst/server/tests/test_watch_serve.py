"""Watchers on a real server: those that wait, leave, or never read."""

import json
import socket
import threading
import time
from contextlib import suppress

import pytest
from raw_http import answered, read_answer, request

pytestmark = pytest.mark.slow

# How long the server waits, at the stop, for a client that has sent half a request.
SOON_DROPPED = {"gym_server.http_server.server._HALF_SENT_SECONDS": 0.5}


@pytest.fixture
def server(serve):
    return serve(limits=SOON_DROPPED)


@pytest.fixture
def pole(server):
    url = server.create("CartPole-v1")
    server.post(f"{url}/reset/")
    return url


def ask(url, after=None):
    query = "" if after is None else f"?after={after}"
    return request("GET", f"{url}/watch/state/{query}")


def look(server, url, after=None):
    with server.socket() as connection:
        return json.loads(answered(connection, ask(url, after))[2])


def step(server, url, times=1):
    connection = server.connect()
    for _ in range(times):
        connection.request("POST", f"{url}/step/", b'{"action":0}')
        assert connection.getresponse().read().startswith(b'{"observation"')
    connection.close()


def test_the_stop_does_not_wait_for_watchers(server, pole):
    number = look(server, pole)["number"]
    watchers = [server.socket() for _ in range(5)]
    for watcher in watchers:
        watcher.sendall(ask(pole, number))
    time.sleep(0.3)
    # Much less than a watcher waits when nothing moves.
    assert server.stop(timeout=8)[0] == 0
    for watcher in watchers:
        assert read_answer(watcher)[0] == 503
        watcher.close()


@pytest.fixture
def deaf(server, pole):
    """Send requests without reading, until the server can send no more to this watcher."""
    with server.socket() as connection:
        asked = []

        def ask_for_ever():
            with suppress(OSError):
                while True:
                    connection.sendall(ask(pole))
                    asked.append(time.monotonic())

        thread = threading.Thread(target=ask_for_ever, daemon=True)
        thread.start()
        # It cannot send any more, because the server does not read any more.
        while not asked or time.monotonic() < asked[-1] + 0.3:
            time.sleep(0.05)
        yield
        with suppress(OSError):
            connection.shutdown(socket.SHUT_RDWR)
        thread.join()


def test_what_is_asked_after_watching_is_answered_at_the_stop(server, gate, eventually):
    url = server.create("faulty_envs:Gated-v0", kwargs=gate.kwargs)
    server.post(f"{url}/reset/")
    with server.socket() as connection:
        assert answered(connection, ask(url))[0] == 200
        connection.sendall(request("POST", f"{url}/step/", b'{"action":0}'))
        eventually(gate.is_reached)
        server.process.terminate()
        eventually(server.takes_no_more)
        # Longer than the server waits for half a request.
        time.sleep(1)
        gate.open()
        assert read_answer(connection)[0] == 200


def test_a_watcher_that_never_reads_holds_nobody_up(server, pole, deaf):
    seen = look(server, pole)
    for count in range(1, 6):
        step(server, pole, 20)
        while seen["steps"] < 20 * count:
            seen = look(server, pole, seen["number"])
