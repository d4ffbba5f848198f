import functools
import importlib.metadata
import json
import re
import subprocess
import sys

import gymnasium
import pytest
from conftest import SERVER
from gymnasium.envs.classic_control.cartpole import CartPoleEnv, CartPoleVectorEnv

from gym_server.envs import registry


def found(client, **query):
    return client.get("/v1/registry/", query_string=query).json["environments"]


def test_an_entry_tells_what_one_chooses_by(client):
    entries = {entry["id"]: entry for entry in found(client)}
    assert entries["CartPole-v1"] == {
        "id": "CartPole-v1",
        "max_episode_steps": 500,
        "reward_threshold": 475.0,
        "vectorised": True,
        "extra": None,
        "available": True,
        "reason": None,
    }
    assert entries["Ant-v5"]["extra"] == "mujoco"
    assert entries["LunarLander-v3"]["extra"] == "box2d"
    assert entries["FrozenLake-v1"]["extra"] is None
    assert entries["FrozenLake-v1"]["available"] is True
    assert entries["Ant-v2"]["available"] is False
    assert entries["GymV21Environment-v0"]["available"] is False
    assert {spec.id for spec in gymnasium.registry.values()} <= entries.keys()


def test_an_entry_that_is_not_available_says_why(client):
    entries = {entry["id"]: entry for entry in found(client)}
    assert all((entry["reason"] is None) == entry["available"] for entry in entries.values())
    assert entries["Ant-v2"]["reason"] == "it is no longer part of Gymnasium"
    assert "may import any module" in entries["GymV21Environment-v0"]["reason"]


def test_what_is_not_installed_is_a_reason_by_name():
    modules = ("Box2D", "jax", "no_such_package")
    code = """
import gymnasium, json
from gym_server.envs import registry
gymnasium.register("Elsewhere-v0", "no_such_package.envs:Env")
ids = ("LunarLander-v3", "phys2d/CartPole-v1", "Elsewhere-v0")
print(json.dumps([registry.search(env_id, [])[0]["reason"] for env_id in ids]))
"""
    assert python(hidden(*modules) + code) == [
        "it needs the server's extra 'box2d'",
        "it needs the server's extra 'jax'",
        "it needs the Python package 'no_such_package', which no extra installs",
    ]


def test_an_environment_of_an_older_mujoco_says_so(client, monkeypatch):
    pytest.importorskip("mujoco")
    monkeypatch.setattr(importlib.metadata, "version", lambda package: "3.2.1")
    assert found(client, search="Pusher-v4")[0]["reason"] == "it needs a MuJoCo before version 3"


def test_half_of_an_extra_is_not_enough():
    # Without flax, Gymnasium's JAX environments cannot be imported.
    code = """
import json, sys, types
sys.modules["jax"] = types.ModuleType("jax")
sys.modules["flax"] = None
from gym_server.envs import registry
print(json.dumps(registry.search("phys2d/CartPole-v1", [])[0]["reason"]))
"""
    assert python(code) == "it needs the server's extra 'jax'"


@pytest.fixture
def registered(monkeypatch):
    """Register an environment for a test."""

    def registered(env_id, **how):
        spec = gymnasium.envs.registration.EnvSpec(env_id, **how)
        monkeypatch.setitem(gymnasium.registry, env_id, spec)

    return registered


def test_what_a_partial_function_makes_can_be_made_and_breaks_no_search(client, registered):
    maker = functools.partial(CartPoleEnv, sutton_barto_reward=True)
    registered("Partial-v0", entry_point=maker)
    assert found(client, search="Partial-v0")[0]["available"] is True
    assert registry.module_of(gymnasium.spec("Partial-v0")) == CartPoleEnv.__module__
    assert (
        client.post("/v1/envs/", json={"env_id": "Partial-v0"}).json["render_mode"] == "rgb_array"
    )
    answer = client.post("/v1/envs/", json={"env_id": "CartPol-v1"})
    assert (answer.status_code, answer.json["code"]) == (400, "unknown_env_id")


def test_what_is_only_a_vector_environment_is_made_with_num_envs(client, registered):
    registered("OnlyVector-v0", vector_entry_point=CartPoleVectorEnv, max_episode_steps=9)
    assert found(client, search="OnlyVector-v0")[0]["available"] is True
    made = client.post("/v1/envs/", json={"env_id": "OnlyVector-v0", "num_envs": 2}).json
    assert made["vectorization_mode"] == "vector_entry_point"
    assert made["max_episode_steps"] == 9
    for fields in ({}, {"num_envs": 2, "vectorization_mode": "sync"}):
        answer = client.post("/v1/envs/", json={"env_id": "OnlyVector-v0", **fields})
        assert (answer.status_code, answer.json["code"]) == (400, "not_supported")
        assert "num_envs" in answer.json["hint"]


@pytest.mark.parametrize("text", ["cartpole", "CARTPOLE-v", "artPole"])
def test_a_search_finds_parts_of_ids(client, text):
    ids = {entry["id"] for entry in found(client, search=text)}
    assert {"CartPole-v0", "CartPole-v1"} <= ids
    assert all(text.lower() in env_id.lower() for env_id in ids)


@pytest.mark.parametrize("text", ["CartPol-v1x", "lunarlnder-v3"])
def test_a_search_that_finds_nothing_finds_what_is_near(client, text):
    ids = [entry["id"] for entry in found(client, search=text)]
    assert {"CartPol-v1x": "CartPole-v1", "lunarlnder-v3": "LunarLander-v3"}[text] in ids
    assert len(ids) <= 10


def test_an_empty_search_is_none_and_nonsense_finds_nothing(client):
    assert len(found(client, search="")) == len(found(client))
    assert found(client, search="zzzzzzzzzzz") == []


def test_what_an_allowed_module_registers_belongs_to_it(client):
    assert [entry["id"] for entry in found(client, search="RaisesInStep")] == ["RaisesInStep-v0"]


@pytest.mark.parametrize("env_id", ["GymV21Environment-v0", "GymV26Environment-v0"])
@pytest.mark.parametrize("name", ["{}", "faulty_envs:{}"])
def test_an_environment_that_imports_what_it_is_told_is_refused(client, monkeypatch, env_id, name):
    # As shimmy registers it.
    spec = gymnasium.envs.registration.EnvSpec(env_id, lambda env_id: __import__(env_id))
    monkeypatch.setitem(gymnasium.registry, env_id, spec)
    assert [entry["available"] for entry in found(client, search=env_id)] == [False]
    full = name.format(env_id)
    for asked in (full, full.removesuffix("-v0")):
        fields = {"env_id": asked, "kwargs": {"env_id": "this"}}
        answer = client.post("/v1/envs/", json=fields)
        assert (answer.status_code, answer.json["code"]) == (400, "module_not_allowed")
    assert "this" not in sys.modules


def python(code):
    """Run code in its own process; return the JSON that it prints."""
    command = [sys.executable, "-c", code]
    return json.loads(subprocess.check_output(command, cwd=SERVER, text=True, timeout=60))


def hidden(*modules):
    return f"import sys\nfor name in {modules}: sys.modules[name] = None\n"


CREATE = """
import json
import re
from gym_server.api.app import create_app
client = create_app().test_client()
seen = []
for env_id in ENV_IDS:
    answer = client.post("/v1/envs/", json={"env_id": env_id})
    found = client.get("/v1/registry/", query_string={"search": env_id}).json["environments"]
    seen.append([answer.status_code, answer.json, found])
print(json.dumps(seen))
"""

EXTRAS = {
    "LunarLander-v3": ("box2d", "gymnasium[box2d]"),
    "CarRacing-v3": ("box2d", "gymnasium[box2d]"),
    "Ant-v5": ("mujoco", "gymnasium[mujoco]"),
    "ALE/Pong-v5": ("atari", '"gymnasium[atari]" "opencv-python-headless"'),
}


@pytest.mark.slow
def test_an_environment_whose_extra_is_missing_names_it():
    nothing = hidden("Box2D", "mujoco", "ale_py")
    seen = python(nothing + f"ENV_IDS = {list(EXTRAS)!r}" + CREATE)
    for (env_id, (extra, requirement)), (status, answer, entries) in zip(
        EXTRAS.items(), seen, strict=True
    ):
        assert (status, answer["code"]) == (400, "missing_dependency")
        assert answer["message"] == f"{env_id} needs the server's extra '{extra}'"
        assert answer["extra"] == extra
        assert re.match(r'in a terminal: ".*python.*" -m pip install ', answer["hint"])
        assert requirement in answer["hint"]
        assert all(entry["available"] is False for entry in entries if entry["id"] == env_id)


@pytest.mark.slow
def test_packages_are_imported_when_an_id_needs_them_and_not_before():
    pytest.importorskip("ale_py")
    code = """
import json, sys
from gym_server.api.app import create_app
client = create_app().test_client()
seen = []
for env_id in ("CartPole-v1", "PongNoFrameskip-v4"):
    answer = client.post("/v1/envs/", json={"env_id": env_id})
    seen.append([answer.status_code, "ale_py" in sys.modules])
print(json.dumps(seen))
"""
    assert python(code) == [[200, False], [200, True]]


def test_an_id_that_is_near_is_found_in_any_case():
    assert registry.near("cartpole-v1") == registry.near("CartPole-v1")
