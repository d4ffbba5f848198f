"""Rollouts whose processes, clients or environments fail."""

import contextlib
import os
import signal
import threading
import time

import pytest
from rollout_requests import RANDOM, read_answer, refused, request_body, roll_out
from running import descendants, is_running

from gym_server.processes.worker_process import kill_overdue
from gym_server.protocol.safetensors import TENSORS

pytestmark = pytest.mark.slow

LAKE = {"env_id": "FrozenLake-v1"}


def in_background(call):
    """Call a function in a thread; return a function that waits for its result."""
    results = []
    thread = threading.Thread(target=lambda: results.append(call()))
    thread.start()

    def wait():
        thread.join(120)
        return results[0]

    return wait


def asked(server, seeds, **how):
    """Request episodes from a real server; return the arrays of the response."""
    with contextlib.closing(server.connect()) as connection:
        body = request_body(seeds, **how)
        connection.request("POST", "/v1/rollouts/", body, {"Content-Type": TENSORS})
        return read_answer(connection.getresponse().read())[0]


def ask_and_leave(server, seconds, seeds, **how):
    """Request episodes from a real server, and disconnect before the response."""
    with contextlib.closing(server.connect()) as connection:
        body = request_body(seeds, **how)
        connection.request("POST", "/v1/rollouts/", body, {"Content-Type": TENSORS})
        time.sleep(seconds)


def test_an_episode_that_hangs_is_ended_and_named(quick, gate, eventually):
    # Without a limit, because starting a process takes long on a busy machine.
    app = quick(max_call_seconds=0, max_processes=1)
    how = {"env_id": "faulty_envs:Gated-v0", "kwargs": gate.kwargs, "max_steps": 5}
    answer = in_background(lambda: refused(app.test_client(), [4, 5], **how))
    eventually(gate.is_reached)
    # The first look only notes how many steps there were.
    for _ in range(2):
        kill_overdue(0)
    refusal = answer()
    assert refusal["code"] == "call_too_long"
    assert refusal["message"].endswith("(in faulty_envs:Gated-v0, episode of seed 4)")
    assert len(roll_out(app.test_client(), range(9), **LAKE)[0]["return"]) == 9


def test_steps_that_go_on_are_no_hang(quick, eventually):
    app = quick(max_call_seconds=0, max_processes=1)
    rollouts = app._rollouts
    how = {"env_id": "faulty_envs:Counting-v0", "kwargs": {"seconds": 0.05, "length": 30}}
    answer = in_background(lambda: roll_out(app.test_client(), [1], max_steps=30, **how))
    eventually(lambda: any(one.process and one.process.progress[0] for one in rollouts._players))
    process = rollouts._players[0].process
    kill_overdue(60)
    # As if its last step had been too long ago, and then comes another one.
    steps, process._since = process._last_progress, process._since - 100
    eventually(lambda: process.progress[0] > steps)
    kill_overdue(60)
    assert answer()[0]["length"].tolist() == [30]


def test_an_episode_that_ends_its_process_each_time_is_refused(client):
    how = {"env_id": "faulty_envs:Rogue-v0", "kwargs": {"does": "exits"}, "max_steps": 5}
    refusal = refused(client, [4, 5], **how)
    assert refusal["code"] == "environment_died"
    assert "seed 4" in refusal["message"]
    assert "exit status 7" in refusal["message"]
    assert len(roll_out(client, range(9), **LAKE)[0]["return"]) == 9


@pytest.mark.parametrize("does", ["interrupts", "leaves", "ends_a_generator"])
def test_what_would_end_a_thread_ends_an_episode(client, does):
    how = {"env_id": "faulty_envs:Rogue-v0", "kwargs": {"does": does}, "max_steps": 5}
    assert refused(client, [4, 5], **how)["code"] == "environment_error"


def pids_of(rollouts):
    return [one.process.pid for one in list(rollouts._players) if one.process is not None]


def test_a_process_that_is_killed_changes_no_result(quick, eventually, monkeypatch):
    monkeypatch.setenv("PYTHON_CPU_COUNT", "2")
    app = quick()
    client = app.test_client()
    how = {"env_id": "LunarLander-v3", "max_steps": 200}
    expected, _ = roll_out(client, range(100), **how)
    rollouts = app._rollouts
    answer = in_background(lambda: roll_out(app.test_client(), range(100), **how))
    for _ in range(2):
        eventually(
            lambda: any(one.process and one.process.progress[0] for one in rollouts._players)
        )
        killed = pids_of(rollouts)[0]
        os.kill(killed, signal.SIGKILL)
        eventually(lambda killed=killed: killed not in pids_of(rollouts))
    arrays, metadata = answer()
    assert metadata == {}
    assert arrays["return"].tolist() == expected["return"].tolist()


def test_a_queue_that_is_full_asks_to_come_again(quick, tmp_path, eventually, monkeypatch):
    monkeypatch.setattr("gym_server.manager.rollouts._MOST_REQUESTS", 1)
    app = quick(max_processes=1)
    how = {"env_id": "faulty_envs:Gated-v0", "kwargs": {"directory": str(tmp_path)}}
    first = in_background(lambda: roll_out(app.test_client(), [1], max_steps=2, **how))
    eventually((tmp_path / "begun").exists)
    answer = app.test_client().post(
        "/v1/rollouts/", data=request_body([1], **LAKE), content_type=TENSORS
    )
    assert answer.status_code == 429
    assert answer.json["code"] == "too_many_rollouts"
    assert answer.headers["Retry-After"] == "1"
    (tmp_path / "open").touch()
    assert first()[0]["length"].tolist() == [2]


def test_episodes_of_a_client_that_leaves_are_not_played(serve):
    server = serve("--max-processes", "1", "--allow-module", "faulty_envs")
    ask_and_leave(server, 0.5, range(100_000), env_id="LunarLander-v3")
    began = time.monotonic()
    assert len(asked(server, [1, 2], **LAKE)["return"]) == 2
    # Long before the others could have been played.
    assert time.monotonic() - began < 20


def test_a_step_that_nobody_waits_for_is_ended(serve):
    limits = {"gym_server.manager.rollouts._UNWANTED_SECONDS": 0.1}
    server = serve("--max-processes", "1", "--allow-module", "faulty_envs", limits=limits)
    ask_and_leave(server, 1, [1], env_id="faulty_envs:Hanging-v0", max_steps=3)
    assert len(asked(server, [1], **LAKE)["return"]) == 1


def test_a_process_that_loses_its_pipe_has_died(quick):
    app = quick()
    how = {"env_id": "faulty_envs:Rogue-v0", "max_steps": 5}
    kwargs = {"does": "closes_all_files"}
    assert refused(app.test_client(), [1], kwargs=kwargs, **how)["code"] == "environment_died"


def test_processes_are_used_again_by_the_next_rollout(quick, monkeypatch, eventually):
    monkeypatch.setattr("gym_server.manager.rollouts._IDLE_SECONDS", 0.05)
    app = quick(max_processes=1)
    roll_out(app.test_client(), [1], **LAKE)
    pids = pids_of(app._rollouts)
    eventually(lambda: not pids_of(app._rollouts))
    roll_out(app.test_client(), [1], **LAKE)
    assert pids_of(app._rollouts) == pids


def test_the_end_of_a_server_ends_rollouts(serve, eventually):
    server = serve()
    connection = server.connect()
    body = request_body(range(100_000), env_id="LunarLander-v3")
    connection.request("POST", "/v1/rollouts/", body, {"Content-Type": TENSORS})
    eventually(lambda: len(descendants(server.process.pid)) > 2)
    pids = descendants(server.process.pid)
    server.process.terminate()
    with contextlib.closing(connection):
        answer = connection.getresponse()
        assert (answer.status, b"shutting_down" in answer.read()) == (503, True)
    server.process.wait(20)
    eventually(lambda: not any(map(is_running, pids)))


def test_a_server_without_processes_says_so(quick):
    client = quick(max_processes=0).test_client()
    refusal = refused(client, [1], policy=RANDOM, **LAKE)
    assert refusal["code"] == "too_many_processes"
