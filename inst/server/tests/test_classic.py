"""Behaviour that clients of openai/gym-http-api in a dozen languages depend on."""

import json

import pytest

ENV_ID = "CartPole-v0"


@pytest.fixture(params=[True, False], ids=["slash", "no slash"])
def path(request):
    """Write a URL as clients do: with or without its last slash."""
    return lambda url: url.rstrip("/") + ("/" if request.param else "")


@pytest.fixture(params=["application/json", "text/plain", None])
def post(request, client):
    """Post JSON with the content types that clients declare."""
    return lambda url, body=None: client.post(
        url, data=None if body is None else json.dumps(body), content_type=request.param
    )


def test_a_whole_session(client, path, post):
    made = post(path("/v1/envs/"), {"env_id": ENV_ID})
    # The other fields are new; classic clients ignore them.
    assert next(iter(made.json)) == "instance_id"
    instance_id = made.json["instance_id"]
    url = f"/v1/envs/{instance_id}"
    listed = client.get(path("/v1/envs/")).json
    assert listed == {"all_envs": {instance_id: ENV_ID}}

    observation = post(path(f"{url}/reset/")).json["observation"]
    assert len(observation) == 4
    answer = post(path(f"{url}/step/"), {"action": 1, "render": True}).json
    assert len(answer["observation"]) == 4
    assert answer["reward"] == 1.0
    assert answer["done"] is False
    assert answer["info"] == {}

    info = client.get(path(f"{url}/action_space/")).json["info"]
    assert (info["name"], info["n"]) == ("Discrete", 2)
    assert client.get(path(f"{url}/action_space/sample")).json["action"] in (0, 1)
    assert client.get(path(f"{url}/action_space/contains/1")).json == {"member": True}
    assert client.get(path(f"{url}/action_space/contains/2")).json == {"member": False}
    info = client.get(path(f"{url}/observation_space/")).json["info"]
    assert (info["name"], info["shape"]) == ("Box", [4])
    assert len(info["low"]) == len(info["high"]) == 4
    assert info["high"][1] == 1e100
    claim = {"name": "Box", "shape": [4]}
    assert post(path(f"{url}/observation_space/contains"), claim).json == {"member": True}

    closed = post(path(f"{url}/close/"))
    assert (closed.status_code, closed.data) == (204, b"")
    assert closed.content_type.startswith("text/html")
    assert client.get(path("/v1/envs/")).json == {"all_envs": {}}


@pytest.mark.parametrize("body", [b"", b"null", b'""', b"[]", b"{}"])
@pytest.mark.parametrize("route", ["reset/", "close/"])
def test_where_nothing_is_required_nothing_may_be_sent(client, create, route, body):
    assert client.post(f"{create(ENV_ID)}/{route}", data=body).status_code in (200, 204)


def test_an_unknown_instance(client):
    calls = [
        client.post("/v1/envs/bad id/reset/"),
        client.post("/v1/envs/bad id/step/", json={"action": 0}),
        client.post("/v1/envs/bad id/close/"),
        client.get("/v1/envs/bad id/action_space/"),
        client.get("/v1/envs/bad id/observation_space/"),
        client.post("/v1/envs/bad id/monitor/start/", json={"directory": "x"}),
        client.post("/v1/envs/bad id/monitor/close/"),
    ]
    for answer in calls:
        assert answer.status_code == 400
        assert answer.json["message"] == "Instance_id bad id unknown"


def test_every_error_names_its_documentation(client, create, faulty):
    """The classic R client prints message and documentation_url, or nothing if one is missing."""
    broken = faulty("RaisesInStep")
    client.post(f"{broken}/reset/")
    answers = [
        client.post("/v1/envs/bad id/reset/"),
        client.post("/v1/envs/", json={"env_id": "bad string"}),
        client.post("/v1/envs/", json={}),
        client.post("/v1/envs/", data=b"{"),
        client.post(f"{create(ENV_ID)}/step/", json={"action": 0}),
        client.post(f"{broken}/step/", json={"action": 1}),
        client.post("/v1/upload/", json={"training_dir": "d", "api_key": "k"}),
        client.get("/nowhere"),
        client.get("/v1/shutdown/"),
    ]
    for answer in answers:
        assert answer.status_code >= 400
        assert answer.json["message"]
        assert answer.json["documentation_url"].startswith("https://github.com/openai/gym-http-api")


def test_a_malformed_environment_id(client):
    answer = client.post("/v1/envs/", json={"env_id": "bad string"})
    assert answer.status_code == 400
    assert answer.json["message"] == "Attempted to look up malformed environment ID 'bad string'"


@pytest.mark.parametrize(
    ("url", "body", "name"),
    [
        ("/v1/envs/", {"wrong": 1}, "env_id"),
        ("/v1/envs/", {"env_id": ""}, "env_id"),
        ("step/", {"wrong": 1}, "action"),
        ("step/", {"action": None}, "action"),
        ("monitor/start/", {"force": True}, "directory"),
        ("monitor/start/", {"directory": ""}, "directory"),
        ("/v1/upload/", {"api_key": "k"}, "training_dir"),
        ("/v1/upload/", {"training_dir": "", "api_key": "k"}, "training_dir"),
        ("/v1/upload/", {"training_dir": "d"}, "api_key"),
        ("/v1/upload/", {"training_dir": "d", "api_key": ""}, "api_key"),
    ],
)
def test_a_missing_parameter(client, create, url, body, name):
    url = url if url.startswith("/") else f"{create(ENV_ID)}/{url}"
    answer = client.post(url, json=body)
    assert answer.status_code == 400
    assert answer.json["message"] == f"A required request parameter '{name}' was not provided"


def test_action_0_is_not_a_missing_action(client, create):
    url = create(ENV_ID)
    client.post(f"{url}/reset/")
    assert client.post(f"{url}/step/", json={"action": 0}).status_code == 200


def test_what_uploads_used_to_be(client):
    answer = client.post(
        "/v1/upload/", json={"training_dir": "d", "api_key": "k", "algorithm_id": None}
    )
    assert (answer.status_code, answer.json["code"]) == (410, "upload_closed")


@pytest.mark.parametrize(
    "body",
    [
        {"directory": "tmp", "force": True},
        {"directory": "tmp", "force": "true", "resume": "false", "video_callable": "false"},
        {"directory": "tmp", "force": True, "resume": False, "video_callable": False},
        {"directory": "tmp", "force": 0, "resume": 1, "video_callable": 0},
    ],
)
def test_a_monitor_is_started_and_closed(client, create, body):
    url = create(ENV_ID)
    started = client.post(f"{url}/monitor/start/", json=body)
    assert (started.status_code, started.data) == (204, b"")
    client.post(f"{url}/reset/")
    closed = client.post(f"{url}/monitor/close/")
    assert (closed.status_code, closed.data) == (204, b"")


def test_continuous_actions_as_classic_clients_send_them(client, create):
    url = create("Pendulum-v1")
    client.post(f"{url}/reset/")
    for action in ([0.5], 0.5, [1], 2):
        assert client.post(f"{url}/step/", json={"action": action}).status_code == 200


def test_a_boolean_is_a_discrete_action_and_a_number_a_flag(client, create):
    """The classic R client sends ``observation[[3]] > 0`` unchanged."""
    urls = [create(ENV_ID) for _ in range(2)]
    for url in urls:
        client.post(f"{url}/reset/", json={"seed": 1})
    for action in (True, False, False):
        taken = [
            client.post(f"{urls[0]}/step/", json={"action": action, "render": 1}),
            client.post(f"{urls[1]}/step/", json={"action": int(action), "render": 0}),
        ]
        assert taken[0].status_code == 200
        assert taken[0].json == taken[1].json


def test_the_random_agents_loop(client, create):
    url = create(ENV_ID)
    for _ in range(3):
        client.post(f"{url}/reset/")
        for _step in range(200):
            action = client.get(f"{url}/action_space/sample").json["action"]
            answer = client.post(f"{url}/step/", json={"action": action, "render": False}).json
            if answer["done"]:
                break
        assert answer["done"]
