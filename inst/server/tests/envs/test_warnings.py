"""Gymnasium's warnings about an environment reach the client that makes it."""

import warnings

import pytest

from gym_server import logs


@pytest.fixture(autouse=True)
def as_in_a_server(monkeypatch):
    monkeypatch.setattr(warnings, "showwarning", logs._show_warning)


def warned(client, env_id, **fields):
    answer = client.post("/v1/envs/", json={"env_id": env_id, **fields})
    assert answer.status_code == 200, answer.json
    return answer.json["warnings"]


@pytest.mark.filterwarnings("always:.*wind_power")
@pytest.mark.parametrize("num_envs", [None, 2])
def test_a_warning_comes_once_and_without_colours(client, num_envs):
    pytest.importorskip("Box2D")
    kwargs = {"enable_wind": True, "wind_power": 30.0}
    for _ in range(2):
        (words,) = warned(client, "LunarLander-v3", kwargs=kwargs, num_envs=num_envs)
        assert words.startswith("wind_power value is recommended to be between 0.0 and 20.0")
        assert words.isprintable()


def test_an_id_that_is_out_of_date_or_has_no_version_says_so(client):
    assert warned(client, "CartPole-v1") == []
    assert warned(client, "CartPole-v0") == [
        "The environment CartPole-v0 is out of date. You should consider upgrading to version `v1`."
    ]
    (words,) = warned(client, "CartPole", num_envs=2)
    assert words.startswith("Using the latest versioned environment `CartPole-v1`")


def test_warnings_of_others_stay_in_the_log():
    with logs.hearing() as heard:
        logs._show_warning("a type of SWIG", DeprecationWarning, "module.py", 1)
    assert heard == []


@pytest.mark.parametrize(
    ("env_id", "module", "engine"),
    [
        ("HalfCheetah-v5", "mujoco", {"mujoco"}),
        ("LunarLander-v3", "Box2D", {"Box2D"}),
        ("ALE/Pong-v5", "ale_py", {"ale-py"}),
        ("CartPole-v1", "gymnasium", set()),
    ],
)
def test_the_engine_is_named_with_its_version(client, env_id, module, engine):
    pytest.importorskip(module)
    answer = client.post("/v1/envs/", json={"env_id": env_id}).json
    described = client.post("/v1/rollouts/", json={"env_id": env_id}).json
    assert answer["engine"] == described["spec"]["engine"]
    assert set(answer["engine"]) == engine
    assert all(version[0].isdigit() for version in answer["engine"].values())
