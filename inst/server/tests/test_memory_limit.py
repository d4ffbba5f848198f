"""When the system gives no more memory, the call gets an error, and the server goes on."""

import contextlib
import json
import subprocess
import sys

import pytest
from conftest import ON_A_FREE_PORT, ServerProcess
from rollout_requests import TENSORS, request_body

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits memory")

HOARDS = "faulty_envs:Hoards-v0"
ASYNC = {"num_envs": 2, "vectorization_mode": "async"}


@pytest.fixture(scope="module")
def small_server():
    # Nobody reads its log, which would fill the pipe.
    server = ServerProcess(*ON_A_FREE_PORT, "--max-memory-mb", "250", stderr=subprocess.DEVNULL)
    yield server
    server.kill()


@pytest.fixture
def small(small_server):
    """Return a server with little memory, on which another environment plays on."""
    other = small_server.create("CartPole-v1")
    assert small_server.post(f"{other}/reset/", {"seed": 1})[0] == 200
    yield small_server
    for _ in range(3):
        assert small_server.post(f"{other}/step/", {"action": 1})[0] == 200
    for instance_id in small_server.get("/v1/envs/")[1]["all_envs"]:
        assert small_server.post(f"/v1/envs/{instance_id}/close/")[0] == 204


def refused(answer, what="large"):
    status, body = answer
    if what == "small" and body["code"] == "environment_error":
        # Where not a byte is left, CPython may raise a SystemError, which says nothing of memory.
        return body["message"]
    assert (status, body["code"]) == (429, "too_much_memory"), body
    assert "--max-memory-mb" in body["hint"]
    return body["message"]


def play(server, url, at):
    if at != "reset":
        assert server.post(f"{url}/reset/")[0] == 200
    if at == "render":
        return server.get(f"{url}/render/")
    action = {"action": 0} if at == "step" else {}
    return server.post(f"{url}/{at}/", action)


def test_a_step_that_takes_all_memory_is_an_error_and_the_others_go_on(small):
    url = small.create(HOARDS)
    assert "MemoryError" in refused(play(small, url, "step"))
    # It has given everything back.
    assert small.post(f"{url}/reset/")[0] == 200


def test_what_a_closed_environment_took_is_there_for_the_next(small):
    for _ in range(3):
        url = small.create("faulty_envs:Large-v0", kwargs={"megabytes": 150})
        assert small.post(f"{url}/close/")[0] == 204


@pytest.mark.slow
@pytest.mark.parametrize("at", ["constructor", "reset", "step", "render"])
@pytest.mark.parametrize("what", ["large", "small", "threads"])
def test_so_is_every_call_that_takes_it(small, what, at):
    kwargs = {"what": what, "at": at}
    if at == "constructor":
        refused(small.post("/v1/envs/", {"env_id": HOARDS, "kwargs": kwargs}), what)
    else:
        refused(play(small, small.create(HOARDS, kwargs=kwargs), at), what)


@pytest.mark.slow
@pytest.mark.parametrize("what", ["large", "small", "threads"])
def test_so_is_one_in_a_process_of_sub_environments(small, what):
    kwargs = {"what": what, "at": "constructor"}
    refused(small.post("/v1/envs/", {"env_id": HOARDS, "kwargs": kwargs, **ASYNC}), what)
    url = small.create(HOARDS, kwargs={"what": what}, **ASYNC)
    assert small.post(f"{url}/reset/")[0] == 200
    assert "Sub-environment 0" in refused(small.post(f"{url}/step/", {"action": [0, 0]}), what)
    assert small.post(f"{url}/reset/")[0] == 200


@pytest.mark.slow
@pytest.mark.parametrize("at", ["constructor", "step"])
@pytest.mark.parametrize("what", ["large", "small", "threads"])
def test_so_is_one_in_a_rollout(small, what, at):
    def roll_out(**kwargs):
        body = request_body([1, 2], HOARDS, max_steps=3, kwargs=kwargs)
        with contextlib.closing(small.connect()) as connection:
            connection.request("POST", "/v1/rollouts/", body, {"Content-Type": TENSORS})
            answer = connection.getresponse()
            return answer.status, answer.read()

    status, body = roll_out(what=what, at=at)
    refused((status, json.loads(body)), what)
    assert roll_out(at="nothing")[0] == 200


@pytest.mark.slow
@pytest.mark.parametrize(
    "fields",
    [
        {
            "env_id": "CartPole-v1",
            "wrappers": [
                {"name": "FrameStackObservation", "kwargs": {"stack_size": 10**size}}
                for size in (3, 3, 2)
            ],
        },
        {"env_id": "FrozenLake-v1", "kwargs": {"desc": ["S" * 1000] * 1000}},
        {"env_id": "Humanoid-v5", "num_envs": 1000, "vectorization_mode": "sync"},
    ],
    ids=lambda fields: fields["env_id"],
)
def test_so_is_an_environment_that_is_too_large(small, fields):
    if fields["env_id"] == "Humanoid-v5":
        pytest.importorskip("mujoco")
    refused(small.post("/v1/envs/", fields))
