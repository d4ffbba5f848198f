import os

import gymnasium
import pytest

from gym_server import __version__
from gym_server.api.app import Config, create_app


@pytest.mark.parametrize("seed", [-1, 1.5, [[1]], "1"])
def test_a_seed_that_is_none_is_named(client, create, seed):
    answer = client.post("/v1/envs/", json={"env_id": "CartPole-v1", "seed": seed})
    assert (answer.status_code, answer.json["code"]) == (400, "invalid_parameter")
    assert "'seed'" in answer.json["message"]
    answer = client.post(f"{create()}/reset/", json={"seed": seed})
    assert (answer.status_code, answer.json["code"]) == (400, "invalid_parameter")


@pytest.mark.parametrize(
    ("fields", "code"),
    [
        ({"kwargs": {"gravitation": 1}}, "invalid_kwargs"),
        ({"kwargs": {"render_mode": "human"}}, "invalid_kwargs"),
        ({"kwargs": "fast"}, "invalid_parameter"),
        ({"render_mode": "ansi"}, "invalid_parameter"),
        ({"render_mode": 1}, "invalid_parameter"),
        ({"env_id": "this:That-v0"}, "module_not_allowed"),
        ({"env_id": 7}, "malformed_env_id"),
    ],
)
def test_a_creation_that_cannot_be_is_400(client, fields, code):
    answer = client.post("/v1/envs/", json={"env_id": "CartPole-v1", **fields})
    assert (answer.status_code, answer.json["code"]) == (400, code)


def test_unknown_fields_are_ignored(client, create):
    assert client.post(f"{create()}/reset/", json={"colour": "red"}).status_code == 200


@pytest.mark.parametrize("options", [3, "fast", [1]])
def test_options_that_are_no_object_are_refused(client, create, options):
    answer = client.post(f"{create()}/reset/", json={"options": options})
    assert answer.json["code"] == "invalid_parameter"


@pytest.mark.parametrize(
    ("x", "member"),
    [("0", True), ("1", True), ("1.0", True), ("2", False), ("true", True), ("left", False)],
)
def test_contains_reads_the_value_from_the_url(client, create, x, member):
    url = create()
    assert client.get(f"{url}/action_space/contains/{x}").json == {"member": member}
    assert client.get(f"{url}/action_space/contains/{x}/").json == {"member": member}


@pytest.mark.parametrize("space", ["action_space", "observation_space"])
def test_contains_takes_a_value_or_a_description(client, create, space):
    url = f"{create('Pendulum-v1')}/{space}"
    info = client.get(f"{url}/").json["info"]
    assert client.post(f"{url}/contains", json={"value": info["high"]}).json == {"member": True}
    assert client.post(f"{url}/contains", json={"value": [99] * 3}).json == {"member": False}
    assert client.post(f"{url}/contains", json=info).json == {"member": True}
    assert client.post(f"{url}/contains/", json={"name": "Tuple"}).json == {"member": False}


def test_a_sample_is_an_action(client, create):
    url = f"{create('Pendulum-v1')}/action_space"
    action = client.get(f"{url}/sample").json["action"]
    assert client.post(f"{url}/contains", json={"value": action}).json == {"member": True}


def test_health_tells_versions(client, create):
    create()
    answer = client.get("/v1/health/").json
    assert answer["status"] == "ok"
    assert answer["instances"] == 1
    assert answer["pid"] == os.getpid()
    assert answer["versions"]["gym_server"] == __version__
    assert answer["versions"]["gymnasium"] == gymnasium.__version__


def test_shutdown_answers_and_asks_for_the_stop(monitor_dir):
    stops = []
    app = create_app(Config(monitor_dir=monitor_dir, stop=lambda: stops.append(True)))
    answer = app.test_client().post("/v1/shutdown/")
    assert (answer.status_code, answer.json) == (200, {"message": "Server shutting down"})
    assert stops == [True]
    app.close()


@pytest.mark.parametrize("accept", ["text/html", "text/html,application/xml;q=0.9,*/*;q=0.8"])
def test_shutdown_answers_html_to_who_asks_for_that(monitor_dir, accept):
    app = create_app(Config(monitor_dir=monitor_dir))
    answer = app.test_client().post("/v1/shutdown/", headers={"Accept": accept})
    assert (answer.status_code, answer.text) == (200, "Server shutting down")
    assert answer.content_type == "text/html; charset=utf-8"
    app.close()


@pytest.mark.parametrize("accept", ["*/*", "application/json", ""])
def test_others_get_json(monitor_dir, accept):
    app = create_app(Config(monitor_dir=monitor_dir))
    answer = app.test_client().post("/v1/shutdown/", headers={"Accept": accept})
    assert answer.json == {"message": "Server shutting down"}
    app.close()


@pytest.mark.parametrize("slash", ["", "/"])
def test_delete_closes(client, create, slash):
    url = create()
    answer = client.delete(f"{url}{slash}")
    assert (answer.status_code, answer.data) == (204, b"")
    assert client.get("/v1/envs/").json == {"all_envs": {}}
    assert client.delete(f"{url}{slash}").json["code"] == "unknown_instance"


def test_a_numbered_delete_closes_once(client, create):
    url = create()
    request = {"key": "k", "number": 1}
    for _ in range(2):
        answer = client.delete(f"{url}/", json={"request": request})
        assert (answer.status_code, answer.headers["Gym-Request"]) == (204, "k 1")


def test_delete_finishes_the_monitor(client, create, monitor_dir):
    url = create()
    client.post(f"{url}/monitor/start/", json={"directory": "run"})
    client.delete(f"{url}/")
    assert (monitor_dir / "run" / "episodes.csv").read_text().startswith("episode,")
    assert client.post(f"{create()}/monitor/start/", json={"directory": "run"}).status_code == 400


@pytest.mark.parametrize(
    ("fields", "code"),
    [
        ({"directory": "../up"}, "monitor_directory"),
        ({"directory": "/etc/gym"}, "monitor_directory"),
        ({"directory": 5}, "invalid_parameter"),
        ({"directory": "run", "force": "perhaps"}, "invalid_parameter"),
        ({"directory": "run", "video_callable": -1}, "invalid_parameter"),
        ({"directory": "run", "video_callable": 1.5}, "invalid_parameter"),
    ],
)
def test_a_monitor_that_cannot_be_started_is_400(client, create, fields, code):
    url = create()
    answer = client.post(f"{url}/monitor/start/", json=fields)
    assert (answer.status_code, answer.json["code"]) == (400, code)
    assert client.get(url).json["monitor"] is None
