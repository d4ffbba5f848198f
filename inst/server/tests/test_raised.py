"""Any exception of an environment becomes a response, which is stored for repetitions."""

import signal
import subprocess

import pytest
from conftest import ServerProcess

pytestmark = pytest.mark.slow

KINDS = {"interrupts": "KeyboardInterrupt", "leaves": "SystemExit", "ends_a_generator": "Generator"}


@pytest.fixture(scope="module")
def server():
    options = {"--port": "0", "--allow-module": "faulty_envs"}
    # Nobody reads its log, which would fill the pipe.
    process = ServerProcess(*sum(options.items(), ()), stderr=subprocess.DEVNULL)
    yield process
    process.kill()


# Sub-environments raise through the same function, so one kind is enough for them.
KINDS_AND_SUB_ENVS = [*((does, None) for does in KINDS), ("leaves", 2)]


@pytest.mark.parametrize(("does", "num_envs"), KINDS_AND_SUB_ENVS)
@pytest.mark.parametrize(
    ("at", "path", "fields"),
    [
        ("step", "step/", {"action": 0}),
        ("reset", "reset/", {}),
        ("close", "close/", {}),
    ],
)
def test_what_ends_a_process_is_an_answer_and_stored(server, does, at, path, fields, num_envs):
    kwargs = {"does": does, "at": at}
    url = server.create("faulty_envs:Rogue-v0", kwargs=kwargs, num_envs=num_envs)
    if num_envs:
        fields = {**fields, "action": [0] * num_envs}
    if at == "step":
        assert server.post(f"{url}/reset/")[0] == 200
    request = {**fields, "request": {"key": url[-8:], "number": 1}}
    status, answer = server.post(f"{url}/{path}", request)
    assert (status, answer["code"]) == (500, "environment_error")
    assert KINDS[does] in answer["message"]
    assert server.post(f"{url}/{path}", request) == (status, answer)
    assert server.get("/v1/health/")[0] == 200


@pytest.mark.parametrize(("does", "num_envs"), KINDS_AND_SUB_ENVS)
def test_a_constructor_that_ends_its_process_is_an_answer(server, does, num_envs):
    how = {"env_id": "faulty_envs:Rogue-v0", "kwargs": {"does": does, "at": "constructor"}}
    request = {**how, "num_envs": num_envs, "request": {"key": f"{does}{num_envs}", "number": 1}}
    status, answer = server.post("/v1/envs/", request)
    assert (status, answer["code"]) == (500, "environment_error")
    assert server.post("/v1/envs/", request) == (status, answer)


@pytest.mark.parametrize("does", KINDS)
def test_drawing_that_ends_its_process_is_an_answer(server, does):
    kwargs = {"does": does, "at": "render"}
    url = server.create("faulty_envs:Rogue-v0", kwargs=kwargs, render_mode="rgb_array")
    server.post(f"{url}/reset/")
    status, answer = server.get(f"{url}/render/")
    assert (status, answer["code"]) == (500, "environment_error")
    # The render thread continues.
    other = server.create("faulty_envs:Drawing-v0")
    server.post(f"{other}/reset/")
    assert server.get(f"{other}/watch/state/")[1]["frame"] is not None


def test_an_operators_ctrl_c_still_stops_the_server(serve):
    server = serve()
    url = server.create("faulty_envs:Rogue-v0", kwargs={"does": "interrupts", "at": "step"})
    server.post(f"{url}/reset/")
    assert server.post(f"{url}/step/", {"action": 0})[0] == 500
    assert server.stop(signal.SIGINT)[0] == 0
