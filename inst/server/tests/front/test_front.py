"""Real fronts with real servers of the users."""

import contextlib
import json
import os
import signal
import socket
import subprocess
from concurrent.futures import ThreadPoolExecutor

import pytest
from front_process import TOKENS, FrontProcess, write_users
from raw_http import answered, read_answer, request
from running import is_running
from stream_client import StreamClient

resource = pytest.importorskip("resource", reason="this system has no fronts")

ANNA, BEN = TOKENS["anna"], TOKENS["ben"]


@pytest.fixture(scope="module")
def front(tmp_path_factory):
    """Return the front that the tests of this file share."""
    folder = tmp_path_factory.mktemp("front")
    with open(folder / "log", "w") as log:
        front = FrontProcess(folder, stderr=log)
    front.log = folder / "log"
    yield front
    front.kill()


@pytest.fixture
def own_front(tmp_path):
    """Return a function that starts a front for a test that stops or floods it."""
    fronts = []

    def own_front(*options, **how):
        fronts.append(FrontProcess(tmp_path, *options, **how))
        return fronts[-1]

    yield own_front
    for front in fronts:
        front.kill()


def asked(token, path="/v1/envs/"):
    """Return what is sent to ask with a token."""
    authorization = [] if token is None else [f"Authorization: Bearer {token}"]
    return request("GET", path, b"", *authorization)


def closes(sock):
    """Return whether the front closes a connection; wait for that as long as the socket does."""
    with contextlib.suppress(ConnectionError):
        while sock.recv(65536):
            pass
    return True


def test_nobody_sees_steps_watches_closes_or_stops_what_another_has(front, eventually):
    url = front.make("anna")
    assert front.ask(ANNA, "GET", "/v1/envs/")[1] == {"all_envs": {url[9:]: "CartPole-v1"}}
    assert front.ask(BEN, "GET", "/v1/envs/")[1] == {"all_envs": {}}
    assert front.ask(BEN, "GET", "/v1/instances/")[1] == {"instances": []}
    for method, path, body in (
        ("POST", f"{url}/step/", {"action": 0}),
        ("POST", f"{url}/reset/", {}),
        ("GET", f"{url}/render/", None),
        ("POST", f"{url}/watch/key/", {}),
        ("GET", f"{url}/watch/state/", None),
        ("POST", f"{url}/close/", {}),
    ):
        status, answer, _ = front.ask(BEN, method, path, body)
        assert (status, answer["code"]) == (400, "unknown_instance"), path
    # A stop is one of the own server.
    before = front.pid_of("ben")
    assert front.ask(BEN, "POST", "/v1/shutdown/", {})[0] == 200
    eventually(lambda: not is_running(before))
    assert front.pid_of("ben") != before
    assert front.steps("anna", url) == 200
    front.ask(ANNA, "POST", f"{url}/close/", {})


def test_a_stream_passes(front):
    url, authorization = front.make("anna"), f"Authorization: Bearer {ANNA}"
    stream = StreamClient(("127.0.0.1", front.port), url, authorization)
    with contextlib.closing(stream):
        assert stream.step(1)[1] == 200
        assert stream.step(1)[1] == 200


def test_a_wrong_token_and_none_get_one_answer(front):
    for token in ("wrong-0123456789abc", None):
        with front.socket() as connection:
            status, headers, body, _ = answered(connection, asked(token))
            assert (status, headers["connection"]) == (401, "close")
            assert headers["www-authenticate"].startswith("bearer")
            assert json.loads(body)["code"] == "unauthorized"
            assert "is not this server's" in json.loads(body)["message"]
            # The right one comes too late, and a body that is still sent does no harm.
            with contextlib.suppress(ConnectionError):
                connection.sendall(asked(ANNA) + b"x" * 100_000)
            assert connection.recv(1) == b""


def test_a_second_token_on_a_connection_is_refused_and_the_connection_closed(front):
    with front.socket() as connection:
        assert answered(connection, asked(ANNA))[0] == 200
        status, headers, _, _ = answered(connection, asked(BEN))
        assert (status, headers["connection"]) == (401, "close")
        assert closes(connection)
    # What curl and browsers do then.
    with contextlib.closing(front.connect()) as connection:
        for token, status in ((ANNA, 200), (BEN, 401), (BEN, 200), (ANNA, 401), (ANNA, 200)):
            assert front.ask(token, "GET", "/v1/envs/", connection=connection)[0] == status


def test_a_key_opens_its_page_and_an_unknown_one_starts_nothing(front):
    url = front.make("anna")
    key = front.ask(ANNA, "POST", f"{url}/watch/key/", {})[1]["key"]
    route, secret = key.split(".")
    assert front.ask(None, "GET", f"{url}/watch/?key={key}")[0] == 200
    assert front.ask(None, "GET", f"{url}/watch/state/?key={key}")[1]["env_id"] == "CartPole-v1"
    # It is no token, and opens no other page.
    assert front.ask(None, "GET", f"/v1/envs/?key={key}")[0] == 401
    assert front.ask(None, "GET", f"{url}/watch/?key={route}.{secret[::-1]}")[0] == 401
    started = front.log.read_text().count("Started the server")
    for unknown in (f"x{key}", secret, ".", "x" * 1000):
        status, answer, headers = front.ask(None, "GET", f"{url}/watch/state/?key={unknown}")
        assert (status, headers["Connection"]) == (401, "close")
        assert "link" in answer["message"]
    # The browser asks for these without a key.
    for name in ("watch.css", "watch.js", "canvas.js/"):
        status, text, headers = front.ask(None, "GET", f"{url}/watch/{name}")
        assert status == 200 and text == front.ask(ANNA, "GET", f"{url}/watch/{name}")[1]
        assert (
            headers["Content-Type"]
            == (front.ask(ANNA, "GET", f"{url}/watch/{name}")[2]["Content-Type"])
        )
    for name in ("watch.html", "../../../../etc/passwd", "none.js"):
        assert front.ask(None, "GET", f"{url}/watch/{name}")[0] == 401
    assert front.log.read_text().count("Started the server") == started
    front.ask(ANNA, "POST", f"{url}/close/", {})


@pytest.mark.parametrize(
    ("sent", "status"),
    [
        (b"\x16\x03\x01\x02\x00", 400),
        (b"GET / HTTP/1.1\r\nX: " + b"x" * 2**14, 400),
        (b"GET\r\n\r\n", 400),
        (b"GET /v1/envs/ HTTP/1.1\r\nAuthorization: Bearer \r\n\r\n", 401),
    ],
)
def test_what_is_no_request_is_refused(front, sent, status):
    with front.socket() as connection:
        assert answered(connection, sent)[0] == status
        assert closes(connection)


def test_a_head_may_arrive_in_pieces(front):
    whole = asked(ANNA)
    with front.socket() as connection:
        for piece in (whole[:1], whole[1:30], whole[30:-1]):
            connection.sendall(piece)
            # The front sees each of them by itself.
            assert front.ask(None, "GET", "/v1/envs/")[0] == 401
        assert answered(connection, whole[-1:])[0] == 200
    # Who leaves within a head leaves nothing.
    with front.socket() as connection:
        connection.sendall(whole[:30])
        connection.shutdown(socket.SHUT_WR)
        assert closes(connection)


def test_no_log_has_a_token_or_a_key(front):
    url = front.make("ben")
    key = front.ask(BEN, "POST", f"{url}/watch/key/", {})[1]["key"]
    front.ask(None, "GET", f"{url}/watch/?key={key}")
    front.ask(BEN + "x", "GET", f"{url}/watch/?key={key}x")
    with front.socket() as connection:
        connection.sendall(asked(BEN) + asked(ANNA))
        assert closes(connection)
    front.ask(BEN, "POST", f"{url}/close/", {})
    log = front.log.read_text()
    assert "Started the server of ben" in log and "sent requests without a token" in log
    for secret in (*TOKENS.values(), *key.split(".")):
        assert secret not in log


def test_a_users_server_that_is_killed_takes_only_its_own(front):
    urls = {name: front.make(name) for name in ("anna", "ben")}
    pid = front.pid_of("ben")
    with contextlib.closing(front.connect()) as connection:
        front.ask(BEN, "GET", "/v1/envs/", connection=connection)
        os.kill(pid, signal.SIGKILL)
        assert closes(connection.sock)
    assert front.steps("anna", urls["anna"]) == 200
    status, answer, _ = front.ask(BEN, "POST", f"{urls['ben']}/step/", {"action": 0})
    assert (status, answer["code"]) == (400, "unknown_instance")
    assert front.pid_of("ben") != pid
    front.ask(ANNA, "POST", f"{urls['anna']}/close/", {})


def test_a_server_that_hangs_takes_no_connection_of_another_and_later_those_that_wait(front):
    pid = front.pid_of("anna")
    with contextlib.ExitStack() as stack:
        os.kill(pid, signal.SIGSTOP)
        stack.callback(os.kill, pid, signal.SIGCONT)
        waiting = [stack.enter_context(front.socket()) for _ in range(64)]
        for connection in waiting:
            connection.sendall(asked(ANNA))
        status, headers, body, _ = answered(stack.enter_context(front.socket()), asked(ANNA))
        assert (status, headers["connection"]) == (429, "close")
        assert json.loads(body)["code"] == "too_many_connections"
        assert front.ask(BEN, "GET", "/v1/envs/")[0] == 200
        os.kill(pid, signal.SIGCONT)
        assert {read_answer(connection)[0] for connection in waiting} == {200}


def test_a_connection_that_an_ending_server_does_not_take_gets_the_next_one(front):
    pid = front.pid_of("ben")
    with front.socket() as waiting, contextlib.closing(front.connect()) as known:
        front.ask(BEN, "GET", "/v1/envs/", connection=known)
        os.kill(pid, signal.SIGSTOP)
        waiting.sendall(asked(BEN, "/v1/health/"))
        # The front has handed the other one over when this is answered.
        assert front.ask(ANNA, "GET", "/v1/envs/")[0] == 200
        os.kill(pid, signal.SIGKILL)
        assert json.loads(read_answer(waiting)[2])["pid"] != pid


def test_the_file_is_read_again_and_who_is_gone_loses_the_server(front, eventually):
    dora = "token-of-dora-0123456789"
    assert front.ask(dora, "GET", "/v1/envs/")[0] == 401
    write_users(front.file, **TOKENS, dora=dora)
    eventually(lambda: front.ask(dora, "GET", "/v1/envs/")[0] == 200)
    pid = front.ask(dora, "GET", "/v1/health/")[1]["pid"]
    with contextlib.closing(front.connect()) as connection:
        front.ask(dora, "GET", "/v1/envs/", connection=connection)
        write_users(front.file, **TOKENS)
        assert closes(connection.sock)
    eventually(lambda: not is_running(pid))
    assert front.ask(dora, "GET", "/v1/envs/")[0] == 401


def test_users_start_at_once_and_the_end_of_the_front_is_the_end_of_their_servers(
    own_front, eventually
):
    front = own_front()
    pids = dict(in_threads(lambda name: (name, front.pid_of(name)), ["anna", "ben", "anna"]))
    assert len(pids) == len(set(pids.values())) == 2 and all(map(is_running, pids.values()))
    front.process.send_signal(signal.SIGKILL)
    eventually(lambda: not any(map(is_running, pids.values())))


@pytest.mark.slow
def test_a_stop_answers_the_requests_in_progress_and_leaves_no_server(own_front):
    front = own_front("--stop-on-stdin-eof")
    url = front.make("anna")
    seen = front.ask(ANNA, "GET", f"{url}/watch/state/")[1]["number"]
    pids = [front.pid_of(name) for name in ("anna", "ben")]
    with front.socket() as waiting:
        waiting.sendall(asked(ANNA, path=f"{url}/watch/state/?after={seen}"))
        # This one is answered after the front has passed the other on.
        front.pid_of("anna")
        front.process.stdin.close()
        front.process.stdin = None
        assert json.loads(read_answer(waiting)[2])["code"] == "shutting_down"
    assert front.stop(how=None)[0] == 0
    assert not any(map(is_running, pids))


@pytest.mark.slow
def test_slow_readers_and_idle_connections_lock_nobody_out(front):
    url, big = front.make("anna"), front.make("ben", num_envs=2000)
    body = json.dumps({"action": [0] * 2000}).encode()
    step = request("POST", f"{big}/step/", body, f"Authorization: Bearer {BEN}")
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with contextlib.ExitStack() as stack:
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, 8192), hard))
        stack.callback(resource.setrlimit, resource.RLIMIT_NOFILE, (soft, hard))
        for _ in range(30):
            reader = stack.enter_context(front.socket())
            reader.sendall(20 * step)
        idle = [stack.enter_context(front.socket()) for _ in range(2000)]
        with contextlib.closing(front.connect()) as connection:
            for _ in range(100):
                assert front.steps("anna", url, connection) == 200
        # There is room for half of them, and those that came first have left.
        assert closes(idle[0]) and closes(idle[900])
        assert answered(idle[-1], asked(ANNA))[0] == 200
    assert front.ask(BEN, "POST", f"{big}/close/", {})[0] == 204


@pytest.fixture(scope="module")
def quick_front(tmp_path_factory):
    """Return a front with short times, whose folder of carl is a file."""
    folder = tmp_path_factory.mktemp("quick")
    (folder / "runs").mkdir()
    (folder / "runs" / "carl").touch()
    front = FrontProcess(
        folder,
        *("--idle-minutes", "0.02"),
        limits={"gym_server.front.front._SHOW_SECONDS": 0.5},
        stderr=subprocess.DEVNULL,
    )
    yield front
    front.kill()


@pytest.mark.slow
@pytest.mark.parametrize("sent", [b"", b"GET / HTTP/1.1\r\nX: "])
def test_who_shows_no_token_in_time_is_closed(quick_front, sent):
    with quick_front.socket() as silent, quick_front.socket() as wrong:
        silent.sendall(sent)
        assert answered(wrong, asked("x" * 16))[0] == 401
        assert closes(silent)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(resource, "prlimit"), reason="only Linux limits others")
def test_a_front_that_may_open_no_more_files_serves_when_some_are_closed(quick_front):
    assert quick_front.ask(BEN, "GET", "/v1/envs/")[0] == 200
    pid = quick_front.process.pid
    before = resource.prlimit(pid, resource.RLIMIT_NOFILE)
    few = len(os.listdir(f"/proc/{pid}/fd")) + 9
    resource.prlimit(pid, resource.RLIMIT_NOFILE, (few, before[1]))
    try:
        with contextlib.ExitStack() as stack:
            for _ in range(15):
                stack.enter_context(quick_front.socket()).sendall(asked(BEN))
            # Who waits is served when those before have left.
        assert quick_front.ask(BEN, "GET", "/v1/envs/")[0] == 200
    finally:
        resource.prlimit(pid, resource.RLIMIT_NOFILE, before)


@pytest.mark.slow
def test_a_server_that_nobody_uses_ends_and_starts_anew(quick_front, eventually):
    url = quick_front.make("anna")
    pid = quick_front.pid_of("anna")
    with contextlib.closing(quick_front.connect()) as connection:
        quick_front.ask(ANNA, "GET", "/v1/envs/", connection=connection)
        eventually(lambda: not is_running(pid))
    status, answer, _ = quick_front.ask(ANNA, "POST", f"{url}/step/", {"action": 0})
    assert (status, answer["code"]) == (400, "unknown_instance")


@pytest.mark.slow
def test_a_server_that_cannot_start_is_an_answer_and_the_others_go_on(quick_front):
    status, answer, headers = quick_front.ask(TOKENS["carl"], "GET", "/v1/envs/")
    assert (status, answer["code"], headers["Connection"]) == (503, "server_unavailable", "close")
    assert quick_front.ask(BEN, "GET", "/v1/envs/")[0] == 200


def in_threads(call, values):
    with ThreadPoolExecutor(len(values)) as threads:
        return list(threads.map(call, values))
