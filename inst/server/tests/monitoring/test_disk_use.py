"""Limits on what monitors write to the disk."""

import csv

import pytest

from gym_server.api.app import Config, create_app
from gym_server.manager.limits import Limits
from gym_server.monitoring import recording

KIB = 1 / 1024


@pytest.fixture
def limited(monitor_dir, monkeypatch):
    """Return a client of an application whose monitors may write little."""
    monkeypatch.setattr(recording, "_MEASURE_SECONDS", 0.0)
    apps = []

    def limited(max_monitor_mb):
        limits = Limits(max_monitor_mb=max_monitor_mb)
        apps.append(create_app(Config(monitor_dir=monitor_dir, limits=limits)))
        return apps[-1].test_client()

    yield limited
    for app in apps:
        app.close()


def created(client):
    answer = client.post("/v1/envs/", json={"env_id": "CartPole-v1"})
    return f"/v1/envs/{answer.json['instance_id']}"


def start(client, url, directory, **fields):
    return client.post(f"{url}/monitor/start/", json={"directory": directory, **fields})


def play(client, url):
    assert client.post(f"{url}/reset/").status_code == 200
    while not client.post(f"{url}/step/", json={"action": 1}).json["done"]:
        pass


def recorded(directory):
    with open(directory / "episodes.csv", newline="") as table:
        return len(list(csv.reader(table))) - 1


def test_a_full_monitor_stops_recording_and_says_so(limited, monitor_dir):
    client = limited(16 * KIB)
    url = created(client)
    assert start(client, url, "run").status_code == 204
    play(client, url)
    # As if this were a video.
    (monitor_dir / "run" / "rl-video-episode-0.mp4").write_bytes(bytes(5000))
    play(client, url)
    play(client, url)
    assert recorded(monitor_dir / "run") == 1
    assert client.get(url).json["monitor"] is None
    closing = client.post(f"{url}/monitor/close/")
    assert (closing.status_code, closing.json["code"]) == (429, "monitors_full")
    assert "--max-monitor-mb" in closing.json["hint"]
    assert client.post(f"{url}/monitor/close/").status_code == 204
    assert client.post(f"{url}/close/").status_code == 204


def test_closing_an_environment_says_it_too(limited):
    client = limited(8 * KIB)
    url = created(client)
    start(client, url, "run")
    play(client, url)
    closing = client.post(f"{url}/close/")
    assert (closing.status_code, closing.json["code"]) == (429, "monitors_full")
    assert client.get(url).status_code == 400


def test_the_limit_is_that_of_all_monitors_and_of_what_they_leave(limited, monitor_dir):
    client = limited(20 * KIB)
    for directory in ("a", "b", "c"):
        url = created(client)
        # The directory and the table.
        assert start(client, url, directory).status_code == 204
        client.post(f"{url}/close/")
    url = created(client)
    refusal = start(client, url, "d")
    assert (refusal.status_code, refusal.json["code"]) == (429, "monitors_full")
    assert not (monitor_dir / "d").exists()
    assert start(client, url, "d", force=True).status_code == 429
    # Its deleted files make room.
    assert start(client, url, "a", force=True).status_code == 204


def test_what_others_wrote_into_a_directory_does_not_count(limited, monitor_dir):
    client = limited(16 * KIB)
    (monitor_dir / "run").mkdir()
    (monitor_dir / "run" / "data.bin").write_bytes(bytes(10**6))
    url = created(client)
    assert start(client, url, "run").status_code == 204
    play(client, url)
    assert client.post(f"{url}/monitor/close/").status_code == 204
