"""Watchers as the real server has them: those that wait, that leave, that never read."""

import json
import socket
import threading
import time

import pytest
from raw_http import answered, read_answer, request


@pytest.fixture
def server(serve):
    return serve()


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
    # Far less than a watcher is kept waiting when nothing moves.
    assert server.stop(timeout=8)[0] == 0
    for watcher in watchers:
        assert read_answer(watcher)[0] == 503
        watcher.close()


def test_the_stop_does_not_wait_for_a_watcher_that_never_reads(server, pole):
    deaf = server.socket()
    thread = threading.Thread(target=ask_for_ever, args=(deaf, pole), daemon=True)
    thread.start()
    step(server, pole, 50)
    time.sleep(1)
    assert server.stop(timeout=8)[0] == 0
    deaf.close()
    thread.join()


@pytest.mark.slow
def test_what_is_asked_after_watching_is_answered_at_the_stop(server):
    url = server.create("faulty_envs:Counting-v0", kwargs={"seconds": 4})
    server.post(f"{url}/reset/")
    with server.socket() as connection:
        assert answered(connection, ask(url))[0] == 200
        connection.sendall(request("POST", f"{url}/step/", b'{"action":0}'))
        time.sleep(0.5)
        server.process.terminate()
        assert read_answer(connection)[0] == 200


def ask_for_ever(connection, url):
    try:
        while True:
            connection.sendall(ask(url))
    except OSError:
        pass


def test_a_watcher_that_never_reads_holds_nobody_up(server, pole):
    deaf = server.socket()
    thread = threading.Thread(target=ask_for_ever, args=(deaf, pole), daemon=True)
    thread.start()
    time.sleep(0.5)
    seen = look(server, pole)
    for count in range(1, 6):
        step(server, pole, 20)
        while seen["steps"] < 20 * count:
            seen = look(server, pole, seen["number"])
    deaf.shutdown(socket.SHUT_RDWR)
    thread.join()
    deaf.close()


def test_a_watcher_that_left_stops_the_drawing(server, pole):
    number = look(server, pole)["number"]
    with server.socket() as watcher:
        watcher.sendall(ask(pole, number))
        time.sleep(0.2)
    # One that it still waited for, and no more.
    for _ in range(5):
        step(server, pole, 10)
        time.sleep(0.1)
    assert look(server, pole)["number"] <= number + 2
