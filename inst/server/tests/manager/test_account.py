"""Memory is measured, and the instance that has grown most is closed."""

import contextlib
import sys

import pytest
from conftest import created

from gym_server.manager import account

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="memory is measured on Linux"),
]

# Drawing this environment takes 64 MiB each time.
HOARDER = {"frame": "hoards"}


def reset(client, url):
    assert client.post(f"{url}/reset/").status_code == 200
    return url


def test_above_the_limit_nothing_grows(client, monkeypatch):
    url = reset(client, created(client, "faulty_envs:Drawing-v0"))
    seeds = reset(client, created(client, num_envs=1, vectorization_mode="sync"))
    monkeypatch.setattr(account.Account, "is_exceeded", True)
    for answer in (
        client.post("/v1/envs/", json={"env_id": "CartPole-v1"}),
        client.get(f"{url}/render/"),
        client.get(f"{url}/watch/state/"),
        client.post(f"{url}/monitor/start/", json={"directory": "videos"}),
        client.post(f"{seeds}/reset/", json={"seed": [[1, 2]]}),
    ):
        assert (answer.status_code, answer.json["code"]) == (429, "too_much_memory")
    for answer in (
        client.post(f"{url}/reset/"),
        client.post(f"{url}/step/", json={"action": 0}),
        client.post(f"{url}/close/"),
    ):
        assert answer.status_code in (200, 204)


@pytest.fixture
def limited(serve):
    """Start a server with a memory limit of 100 MiB."""
    return lambda: serve(
        "--max-memory-mb",
        "100",
        limits={
            "gym_server.manager.account._OWN_BYTES": 0,
            "gym_server.manager.watchdog._MEASURE_SECONDS": 0.1,
        },
    )


def drawn(server, url):
    """Draw a frame; return the status."""
    with contextlib.closing(server.connect()) as connection:
        connection.request("GET", f"{url}/render/")
        with connection.getresponse() as answer:
            return answer.status


@pytest.mark.parametrize("how", [{}, {"num_envs": 2, "vectorization_mode": "sync"}])
def test_what_grows_when_it_is_drawn_is_closed_and_the_others_go_on(limited, eventually, how):
    server = limited()
    other = server.create("CartPole-v1")
    hoarder = server.create("faulty_envs:Drawing-v0", kwargs=HOARDER, **how)
    for url in (other, hoarder):
        assert server.post(f"{url}/reset/")[0] == 200
    for _ in range(2):
        drawn(server, hoarder)
    eventually(lambda: server.get(hoarder)[0] == 410)
    answer = server.get(hoarder)[1]
    assert answer["code"] == "instance_memory_closed"
    assert "had grown most, by " in answer["message"]
    # As soon as the memory is released.
    eventually(lambda: drawn(server, other) == 200)
    assert server.post(f"{other}/reset/")[0] == 200


def test_a_process_that_grows_is_closed(limited, eventually):
    server = limited()
    how = {"num_envs": 1, "vectorization_mode": "async"}
    other = server.create("faulty_envs:Rogue-v0", **how)
    hoarder = server.create("faulty_envs:Rogue-v0", kwargs={"does": "grows"}, **how)
    for url in (other, hoarder):
        assert server.post(f"{url}/reset/")[0] == 200
    server.post(f"{hoarder}/step/", {"action": [0]})
    eventually(lambda: server.get(hoarder)[1].get("code") == "instance_memory_closed")
    eventually(lambda: server.get("/v1/envs/")[1]["all_envs"].keys() == {other[-8:]})
    assert server.post(f"{other}/reset/")[0] == 200
