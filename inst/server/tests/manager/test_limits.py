"""Limits for all clients together."""

import threading

import pytest

from gym_server.api.app import Config, create_app
from gym_server.manager.limits import Limits
from gym_server.vector_envs.sub_envs import SubEnvs

pytestmark = pytest.mark.slow


@pytest.fixture
def limited():
    """Return a client of an application with limits."""
    apps = []

    def limited(**limits):
        apps.append(create_app(Config(allowed_modules=["faulty_envs"], limits=Limits(**limits))))
        return apps[-1].test_client()

    yield limited
    for app in apps:
        app.close()


def make(client, **fields):
    return client.post("/v1/envs/", json={"env_id": "CartPole-v1", **fields})


def refused(answer, code):
    return (answer.status_code, answer.json["code"]) == (429, code)


def test_there_are_only_so_many_instances(limited):
    client = limited(max_instances=2)
    first, second = make(client), make(client)
    refusal = make(client)
    assert refused(refusal, "too_many_instances")
    assert "2 environments" in refusal.json["message"]
    for answer in (first, second):
        assert client.post(f"/v1/envs/{answer.json['instance_id']}/close/").status_code == 204
        assert make(client).status_code == 200


def test_many_that_come_at_once_get_no_more(limited, gate, eventually):
    client = limited(max_instances=3)
    fields = {"env_id": "faulty_envs:Gated-v0", "kwargs": {**gate.kwargs, "where": "init"}}
    statuses = []

    def create():
        answer = client.application.test_client().post("/v1/envs/", json=fields)
        statuses.append(answer.status_code)

    threads = [threading.Thread(target=create) for _ in range(12)]
    for thread in threads:
        thread.start()
    eventually(lambda: statuses == [429] * 9)
    gate.open()
    for thread in threads:
        thread.join()
    assert statuses[9:] == [200] * 3


def test_what_could_not_be_made_takes_no_room(limited):
    client = limited(max_instances=1, max_num_envs=4)
    for _ in range(3):
        assert make(client, env_id="NoSuch-v0").status_code == 400
        assert make(client, num_envs=4, kwargs={"none": 1}).status_code == 400
    assert make(client, num_envs=4).status_code == 200


def test_one_that_is_too_large_hears_of_that(limited):
    refusal = make(limited(max_num_envs=8), num_envs=9)
    assert refused(refusal, "too_many_sub_envs")


def ask_for_processes(client, number):
    return make(client, num_envs=number, num_workers=number)


def test_all_together_have_only_so_many_processes(limited):
    client = limited(max_processes=3)
    first = ask_for_processes(client, 2)
    assert first.status_code == 200
    refusal = ask_for_processes(client, 2)
    assert refused(refusal, "too_many_processes")
    assert refusal.json["message"] == (
        "All environments together may have 3 processes, and 1 are left, not 2"
    )
    assert "--max-processes" in refusal.json["hint"]
    assert ask_for_processes(client, 1).status_code == 200
    # An environment that needs none is not refused.
    assert make(client, num_envs=8).status_code == make(client).status_code == 200
    client.post(f"/v1/envs/{first.json['instance_id']}/close/")
    assert ask_for_processes(client, 2).status_code == 200


def test_processes_that_nobody_asked_for_are_no_more_than_there_is_room_for(limited, monkeypatch):
    monkeypatch.setattr("gym_server.vector_envs.num_workers.usable_cores", lambda: 4)
    client = limited(max_processes=3)

    def chosen_of(client):
        instance_id = make(client, env_id="Acrobot-v1", num_envs=128).json["instance_id"]
        return client.get(f"/v1/envs/{instance_id}").json["num_workers"]

    assert [chosen_of(client), chosen_of(client)] == [3, 0]
    refusal = ask_for_processes(client, 1)
    assert refused(refusal, "too_many_processes")
    # A single process would not be faster.
    assert chosen_of(limited(max_processes=1)) == 0
    # Choosing fewer than were reserved leaves room.
    client = limited(max_processes=4)
    assert make(client, env_id="CliffWalking-v1", num_envs=64).status_code == 200
    assert chosen_of(client) == 4


def test_processes_that_are_started_at_once_are_no_more(limited):
    client = limited(max_processes=4)
    answers = []

    def ask():
        answers.append(ask_for_processes(client.application.test_client(), 2).status_code)

    threads = [threading.Thread(target=ask) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(answers) == [200] * 2 + [429] * 4


def test_processes_count_until_they_have_ended(limited, monkeypatch):
    client = limited(max_processes=2)
    closing, released = threading.Event(), threading.Event()
    close = SubEnvs.close

    def close_when_released(self):
        closing.set()
        released.wait(20)
        close(self)

    url = f"/v1/envs/{ask_for_processes(client, 2).json['instance_id']}"
    monkeypatch.setattr(SubEnvs, "close", close_when_released)
    closer = threading.Thread(target=lambda: client.post(f"{url}/close/"))
    closer.start()
    assert closing.wait(20)
    assert refused(ask_for_processes(client.application.test_client(), 1), "too_many_processes")
    released.set()
    closer.join()
    assert ask_for_processes(client, 2).status_code == 200


def test_a_process_that_ended_by_itself_makes_room(limited, eventually):
    client = limited(max_processes=1)
    kwargs = {"does": "exits", "at": "step"}
    how = {"num_envs": 1, "vectorization_mode": "async"}
    answer = make(client, env_id="faulty_envs:Rogue-v0", kwargs=kwargs, **how)
    url = f"/v1/envs/{answer.json['instance_id']}"
    client.post(f"{url}/reset/")
    assert client.post(f"{url}/step/", json={"action": [0]}).json["code"] == "environment_died"
    eventually(lambda: ask_for_processes(client, 1).status_code == 200)
