"""Calls that take too long, on a real server."""

import contextlib
import http.client
import json
import os
import threading
import time
from pathlib import Path

import pytest
from conftest import ON_A_FREE_PORT, Gate, ServerProcess, created
from faulty_envs import HangsWhere
from running import descendants, is_running

from gym_server.manager import watchdog
from gym_server.manager.limits import Limits

pytestmark = pytest.mark.slow

# Enough time for anything that does not hang.
SOON = 20


class Call:
    """A call in its own thread, on its own connection."""

    def __init__(self, server, method, path, body=None):
        self.connection = server.connect()
        self.outcome = []
        self.began = time.monotonic()
        self.thread = threading.Thread(target=self.run, args=(method, path, json.dumps(body or {})))
        self.thread.start()

    def run(self, method, path, body):
        self.connection.request(method, path, body)
        answer = self.connection.getresponse()
        self.outcome.append((answer.status, json.loads(answer.read() or "null")))
        self.connection.close()

    def answer(self):
        self.thread.join(SOON)
        assert self.outcome, "no answer came"
        return self.outcome[0]


# Calls that do not hang take less, even on a busy machine.
STRICT = ("--max-call-seconds", "1")


@pytest.fixture(scope="module")
def strict():
    """Start a server on which a call may take one second; no hanging call may break it."""
    server = ServerProcess(*ON_A_FREE_PORT, *STRICT)
    yield server
    server.kill()


@pytest.fixture
def call(strict):
    return lambda path, body=None, method="POST": Call(strict, method, path, body)


def too_long(answer):
    status, body = answer
    return (status, body["code"]) == (504, "call_too_long")


def hanging(server, where):
    return server.create("faulty_envs:HangsWhere-v0", kwargs={"where": where})


def test_a_call_that_takes_too_long_is_answered_and_its_instance_is_gone(
    strict, call, gate, eventually
):
    url = strict.create("faulty_envs:Gated-v0", kwargs=gate.kwargs)
    other = strict.create("CartPole-v1")
    strict.post(f"{url}/reset/")
    stuck = call(f"{url}/step/", {"action": 0})
    eventually(gate.is_reached)
    queued = [call(f"{url}/reset/"), call(f"{url}/action_space/sample/", method="GET")]
    # Other instances are not affected.
    assert strict.post(f"{other}/reset/")[0] == 200
    status, body = stuck.answer()
    assert (status, body["code"]) == (504, "call_too_long")
    instance_id = url.rsplit("/", 1)[1]
    assert body["message"] == (
        f"A call on instance {instance_id} of faulty_envs:Gated-v0 took more than 1 seconds, "
        "so the instance is gone"
    )
    assert "--max-call-seconds" in body["hint"]
    assert all(too_long(one.answer()) for one in queued)
    for answer in (
        strict.get(f"{url}/"),
        strict.post(f"{url}/step/", {"action": 0}),
        strict.post(f"{url}/close/"),
    ):
        assert answer == (status, body)
    assert instance_id not in strict.get("/v1/envs/")[1]["all_envs"]
    assert strict.post(f"{other}/step/", {"action": 0})[0] == 200


def test_the_answer_is_given_to_repetitions_too(strict, call):
    url = strict.create("faulty_envs:Hanging-v0")
    strict.post(f"{url}/reset/")
    step = {"action": 0, "request": {"key": "mine", "number": 7}}
    first, second = call(f"{url}/step/", step), call(f"{url}/step/", step)
    status, body = first.answer()
    assert (status, body["request"]) == (504, step["request"])
    assert second.answer() == (status, body)
    assert strict.post(f"{url}/step/", step) == (status, body)
    # The key is free for the next request.
    next_one = {"env_id": "CartPole-v1", "request": {"key": "mine", "number": 8}}
    assert strict.post("/v1/envs/", next_one)[0] == 200


def test_an_environment_may_hang_while_it_is_made(strict, call):
    making = {"env_id": "faulty_envs:HangsWhere-v0", "kwargs": {"where": "init"}}
    before = strict.get("/v1/health/")[1]["instances"]
    stuck = call("/v1/envs/", making)
    assert strict.create("CartPole-v1")
    assert too_long(stuck.answer())
    assert strict.get("/v1/health/")[1]["instances"] == before + 1


@pytest.mark.parametrize("num_envs", [None, 2])
def test_drawing_may_hang_and_others_are_drawn_all_the_same(
    strict, call, gate, eventually, num_envs
):
    fields = {} if num_envs is None else {"num_envs": num_envs}
    kwargs = {**gate.kwargs, "where": "render"}
    url = strict.create("faulty_envs:Gated-v0", kwargs=kwargs, **fields)
    other = strict.create("faulty_envs:Drawing-v0")
    for one in (url, other):
        strict.post(f"{one}/reset/")
    stuck = call(f"{url}/render/", method="GET")
    eventually(gate.is_reached)
    # It waits for its turn, and is not stuck itself.
    waiting = strict.connect()
    waiting.request("GET", f"{other}/render/")
    assert too_long(stuck.answer())
    assert waiting.getresponse().status == 200
    waiting.close()
    assert strict.post(f"{other}/close/")[0] == 204


def test_a_watcher_may_be_the_one_for_whom_it_hangs(strict, call):
    url = hanging(strict, "render")
    strict.post(f"{url}/reset/")
    watchers = [call(f"{url}/watch/state/", method="GET") for _ in range(2)]
    assert all(too_long(one.answer()) for one in watchers)
    other = strict.create("faulty_envs:Drawing-v0")
    strict.post(f"{other}/reset/")
    assert call(f"{other}/watch/state/", method="GET").answer()[0] == 200


def test_closing_may_hang(strict, call):
    url, other = hanging(strict, "close"), strict.create("faulty_envs:Drawing-v0")
    stuck = call(f"{url}/close/")
    assert too_long(stuck.answer())
    assert too_long(strict.get(f"{url}/"))
    assert strict.post(f"{other}/close/")[0] == 204


def test_a_server_with_calls_that_hang_stops_all_the_same(serve):
    server = serve(*STRICT)
    in_reset, in_render = hanging(server, "reset"), hanging(server, "render")
    server.post(f"{in_render}/reset/")
    calls = [
        Call(server, "POST", f"{in_reset}/reset/"),
        Call(server, "GET", f"{in_render}/render/"),
    ]
    assert all(too_long(call.answer()) for call in calls)
    assert server.stop(timeout=SOON)[0] == 0


@pytest.fixture
def impatient_later(quick, monkeypatch):
    """Make an application whose limit of call time can be shortened later.

    Returns the application, and a function that sets the limit to one second. Starting a process
    takes longer than that on a busy machine.
    """

    monkeypatch.setattr(watchdog, "_LONGEST_TICK", 0.1)

    def impatient_later(**how):
        app = quick(max_call_seconds=60, **how)

        def be_impatient():
            app._watchdog._limits = Limits(max_call_seconds=1)

        return app, be_impatient

    return impatient_later


def test_sub_envs_in_processes_end_with_it(impatient_later, eventually):
    app, be_impatient = impatient_later()
    client = app.test_client()
    fields = {"num_envs": 2, "vectorization_mode": "async"}
    url = created(client, "faulty_envs:Hanging-v0", **fields)
    processes = app._instances.get(url.rsplit("/", 1)[1]).gym_env.pids
    client.post(f"{url}/reset/")
    be_impatient()
    answer = client.post(f"{url}/step/", json={"action": [0, 0]})
    assert too_long((answer.status_code, answer.json))
    eventually(lambda: not any(map(is_running, processes)))


def test_a_connection_that_was_answered_for_is_closed(strict, eventually):
    url = hanging(strict, "reset")
    connection = strict.connect()
    connection.request("POST", f"{url}/reset/")
    answer = connection.getresponse()
    assert answer.status == 504
    assert answer.getheader("Connection") == "close"
    answer.read()
    connection.sock is None or connection.sock.close()


def test_what_is_slow_but_not_too_slow_delays_nobody(shared, gate, tmp_path, eventually):
    directory = tmp_path / "drawing"
    directory.mkdir()
    drawing_gate = Gate(directory)
    slow = shared.create("faulty_envs:Gated-v0", kwargs=gate.kwargs)
    kwargs = {**drawing_gate.kwargs, "where": "render"}
    drawing = shared.create("faulty_envs:Gated-v0", kwargs=kwargs)
    other = shared.create("CartPole-v1")
    for url in (slow, drawing):
        shared.post(f"{url}/reset/")
    calls = [
        Call(shared, "POST", f"{slow}/step/", {"action": 0}),
        Call(shared, "GET", f"{drawing}/watch/state/"),
    ]
    eventually(lambda: gate.is_reached() and drawing_gate.is_reached())
    assert shared.get("/v1/health/")[0] == 200
    assert len(shared.get("/v1/instances/")[1]["instances"]) == 3
    assert all(shared.get(f"{url}/")[0] == 200 for url in (slow, drawing, other))
    another = shared.create("CartPole-v1")
    for url in (other, another):
        assert shared.post(f"{url}/reset/")[0] == 200
        assert shared.post(f"{url}/step/", {"action": 0})[0] == 200
    assert all(one.thread.is_alive() for one in calls)
    gate.open()
    drawing_gate.open()
    assert all(one.answer()[0] == 200 for one in calls)


# Without HTTP --------------------------------------------------------------------------------


def test_an_environment_whose_call_comes_back_after_all_is_closed_then(quick, eventually):
    client = quick(max_call_seconds=0.5).test_client()
    before = HangsWhere.closed
    where = {"where": "reset", "hours": 0.8 / 3600}
    url = created(client, "faulty_envs:HangsWhere-v0", kwargs=where)
    answer = client.post(f"{url}/reset/")
    assert (answer.status_code, answer.json["code"]) == (504, "call_too_long")
    eventually(lambda: HangsWhere.closed == before + 1)
    making = {"env_id": "faulty_envs:HangsWhere-v0", "kwargs": {**where, "where": "init"}}
    answer = client.post("/v1/envs/", json=making)
    assert answer.json["code"] == "call_too_long"
    assert "Making faulty_envs:HangsWhere-v0" in answer.json["message"]
    assert client.get("/v1/envs/").json["all_envs"] == {}


def test_one_that_was_evicted_may_hang_once_more_and_others_are_drawn(quick, monkeypatch):
    app = quick(max_call_seconds=0.3)
    closing, released, drawn = threading.Event(), threading.Event(), []

    def close(_):
        closing.set()
        released.wait(3 * SOON)

    def draw():
        client = app.test_client()
        other = created(client, "faulty_envs:Drawing-v0")
        client.post(f"{other}/reset/")
        drawn.append(client.get(f"{other}/render/").status_code)

    monkeypatch.setattr(HangsWhere, "close", close)
    where = {"where": "reset", "hours": 0.6 / 3600}
    url = created(app.test_client(), "faulty_envs:HangsWhere-v0", kwargs=where)
    stuck = threading.Thread(target=lambda: app.test_client().post(f"{url}/reset/"))
    drawing = threading.Thread(target=draw)
    stuck.start()
    assert closing.wait(SOON)
    drawing.start()
    drawing.join(SOON)
    in_time = list(drawn)
    released.set()
    stuck.join(SOON)
    assert in_time == [200]


@pytest.fixture(scope="module")
def impatient():
    """Start a server on which a call may take half a second."""
    options = ("--max-call-seconds", "0.5", "--log-level", "error")
    server = ServerProcess(*ON_A_FREE_PORT, *options)
    yield server
    server.kill()


@pytest.mark.parametrize(
    ("where", "fields"),
    [
        ("init", {}),
        # Worker processes may be chosen, or were chosen.
        ("init", {"num_envs": 64}),
        ("init", {"num_envs": 4, "num_workers": 2}),
        ("init elsewhere", {"num_envs": 4, "num_workers": 2}),
        ("step", {}),
        ("render", {}),
        ("close", {}),
    ],
)
def test_a_loop_without_an_end_is_broken_off(impatient, eventually, where, fields):
    server = impatient

    def threads():
        return len(os.listdir(f"/proc/{server.process.pid}/task"))

    def threads_at_rest():
        """Count them ten times, because the thread of a closed connection ends a little later."""
        counts = []
        for _ in range(10):
            counts.append(threads())
            time.sleep(0.02)
        return min(counts)

    def play():
        making = {"env_id": "faulty_envs:Spins-v0", "kwargs": {"where": where}}
        status, answer = server.post("/v1/envs/", {**making, **fields})
        if status != 200:
            return status, answer
        url = f"/v1/envs/{answer['instance_id']}"
        server.post(f"{url}/reset/")
        if where == "render":
            return server.get(f"{url}/render/")
        return server.post(f"{url}/{where}/", {"action": 0})

    # Now the render thread exists.
    url = server.create("faulty_envs:Drawing-v0")
    server.post(f"{url}/reset/")
    server.get(f"{url}/watch/state/")
    before = threads_at_rest()
    assert too_long(play())
    eventually(lambda: threads() <= before)
    # None of them uses the processor any more.
    eventually(lambda: _busy_threads(server.process.pid) == 0)
    # Only the two remain that start processes.
    eventually(lambda: len(descendants(server.process.pid)) <= 2)


def _busy_threads(pid):
    """Count the threads that Linux reports as running, in five samples."""
    busy = set()
    for _ in range(5):
        for stat in Path(f"/proc/{pid}/task").glob("*/stat"):
            with contextlib.suppress(OSError):
                if stat.read_text().rpartition(")")[2].split()[0] == "R":
                    busy.add(stat.parent.name)
        time.sleep(0.02)
    return len(busy)


def test_0_seconds_are_for_ever(quick):
    client = quick(max_call_seconds=0, idle_minutes=0.01).test_client()
    url = created(client, kwargs={"seconds": 1.0})
    client.post(f"{url}/reset/")
    assert client.post(f"{url}/step/", json={"action": 0}).status_code == 200


def test_an_answer_for_another_never_reaches_the_next_request(strict):
    # The thread returns while the watchdog answers for it, again and again.
    connection = http.client.HTTPConnection("127.0.0.1", strict.port, timeout=SOON)
    for _ in range(2):
        url = strict.create(
            "faulty_envs:HangsWhere-v0", kwargs={"where": "reset", "hours": 1.05 / 3600}
        )
        connection.request("POST", f"{url}/reset/")
        answer = connection.getresponse()
        answer.read()
        assert answer.status in (200, 504)
        connection.request("GET", "/v1/health/")
        assert json.loads(connection.getresponse().read())["status"] == "ok"
    connection.close()


def test_an_answer_for_one_whose_making_fails_never_reaches_its_next_request(quick, monkeypatch):
    app = quick(max_call_seconds=0.2)
    abandoned, came_back, waited = threading.Event(), threading.Event(), []

    def fail(*_):
        abandoned.wait(SOON)
        raise ValueError("too late")

    def answer_for(*_):
        abandoned.set()
        # The creating thread must not return before this is done.
        waited.append(not came_back.wait(0.5))

    def create():
        app.test_client().post("/v1/envs/", json={"env_id": "CartPole-v1"})
        came_back.set()

    monkeypatch.setattr(app._instances, "_make", fail)
    app.answer_for = answer_for
    thread = threading.Thread(target=create)
    thread.start()
    thread.join(SOON)
    assert waited == [True]
