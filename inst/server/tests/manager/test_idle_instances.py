"""Instances that are not used for some time."""

import time

from conftest import created


def test_an_instance_that_nobody_uses_is_closed_and_says_so(quick, eventually):
    client = quick(idle_minutes=0.01).test_client()
    url = created(client)
    eventually(lambda: client.get("/v1/envs/").json["all_envs"] == {})
    for answer in (client.get(url), client.post(f"{url}/reset/"), client.post(f"{url}/close/")):
        assert (answer.status_code, answer.json["code"]) == (410, "instance_idle_closed")
        assert answer.json["message"].endswith(
            "of faulty_envs:Counting-v0 was closed: nobody used it for 0.01 minutes"
        )


def test_an_instance_that_is_used_or_watched_stays(quick):
    # Without a limit, so that only this test looks for idle instances.
    app = quick(idle_minutes=0)
    client = app.test_client()
    used, watched, idle = (created(client) for _ in range(3))
    for instance in app._instances._all():
        instance.lock.used -= 120
    assert client.post(f"{used}/reset/").status_code == 200
    assert client.get(f"{watched}/watch/presence/").status_code == 200
    app._instances.evict_idle(1)
    assert [client.get(url).status_code for url in (used, watched, idle)] == [200, 200, 410]


def test_0_minutes_are_never(quick, monkeypatch):
    monkeypatch.setattr("gym_server.manager.watchdog._LONGEST_TICK", 0.1)
    client = quick(idle_minutes=0).test_client()
    url = created(client)
    time.sleep(0.3)
    assert client.get(url).status_code == 200
