"""Calls that hang in the server's processes, which are ended; the server lives."""

import threading

import pytest
from conftest import created
from running import is_running

from gym_server.processes.pool import pool
from gym_server.processes.worker_process import kill_overdue
from gym_server.threads import calls

pytestmark = pytest.mark.slow

FIELDS = {"num_envs": 2, "num_workers": 2}


@pytest.fixture
def hang(quick, gate, eventually):
    """Send a request that hangs in a process; return its answer after the process was ended."""
    # Without a limit, because starting a process takes long on a busy machine.
    app = quick(max_call_seconds=0)

    def hang(path, body):
        answers = []
        client = app.test_client()
        thread = threading.Thread(target=lambda: answers.append(client.post(path, json=body)))
        thread.start()
        eventually(gate.is_reached)
        # Nothing hangs in this process.
        eventually(lambda: not calls.running)
        kill_overdue(60)
        assert not answers
        eventually(lambda: kill_overdue(0) or answers)
        thread.join()
        return answers[0].status_code, answers[0].json

    return app, hang


def test_a_process_in_which_a_call_hangs_is_ended_with_its_instance(hang, gate, eventually):
    app, hang = hang
    client = app.test_client()
    url = created(client, "faulty_envs:Gated-v0", kwargs=gate.kwargs, **FIELDS)
    other = created(client, "CartPole-v1", **FIELDS)
    pids = app._instances.get(url.rsplit("/", 1)[1]).gym_env.pids
    for one in (url, other):
        assert client.post(f"{one}/reset/").status_code == 200
    status, body = hang(f"{url}/step/", {"action": [0, 0]})
    assert (status, body["code"]) == (504, "call_too_long")
    assert body["message"].startswith("A call took more than 0 seconds, so the environment's proc")
    assert "--max-call-seconds" in body["hint"]
    eventually(lambda: not any(map(is_running, pids)))
    eventually(lambda: list(app._instances.env_ids()) == [other.rsplit("/", 1)[1]])
    answer = client.get(url)
    assert (answer.status_code, answer.json) == (status, body)
    assert client.post(f"{other}/step/", json={"action": [0, 0]}).status_code == 200


def test_an_environment_may_hang_while_it_is_made_in_a_process(hang, gate):
    app, hang = hang
    kwargs = {**gate.kwargs, "where": "init elsewhere"}
    fields = {"env_id": "faulty_envs:Gated-v0", "kwargs": kwargs, **FIELDS}
    status, body = hang("/v1/envs/", fields)
    assert (status, body["code"]) == (504, "call_too_long")
    assert app._instances.env_ids() == {}
    assert created(app.test_client(), "CartPole-v1", **FIELDS)


def test_the_watchdog_ends_them(quick, monkeypatch):
    seconds = threading.Event()
    monkeypatch.setattr("gym_server.manager.watchdog._LONGEST_TICK", 0.01)
    monkeypatch.setattr("gym_server.manager.watchdog.kill_overdue", lambda limit: seconds.set())
    quick(max_call_seconds=0)
    assert not seconds.wait(0.1)
    quick(max_call_seconds=300)
    assert seconds.wait(20)


def test_processes_that_are_idle_for_long_are_ended(app, monkeypatch, eventually):
    process = pool.take("gym_server.vector_envs.group_worker")
    pool.put(process)
    assert is_running(process.pid)
    monkeypatch.setattr("gym_server.processes.pool._IDLE_SECONDS", 0.0)
    eventually(lambda: not is_running(process.pid))
