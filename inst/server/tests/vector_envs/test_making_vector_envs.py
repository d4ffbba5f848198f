import sys
import types

import gymnasium
import pytest
from faulty_envs import Counting
from gymnasium.envs.classic_control.cartpole import CartPoleEnv, CartPoleVectorEnv
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, VectorEnv

from gym_server.api.app import Config, create_app
from gym_server.manager.limits import Limits


class OwnSubEnvs(VectorEnv):
    """A vector implementation that accepts one argument, and resets in the same step."""

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012
    made = 0

    def __init__(self, num_envs, length=5):
        type(self).made += 1
        self.num_envs = num_envs
        self.single_action_space = Counting.action_space
        self.single_observation_space = Counting.observation_space
        batch = gymnasium.vector.utils.batch_space
        self.action_space = batch(self.single_action_space, num_envs)
        self.observation_space = batch(self.single_observation_space, num_envs)


class HasNoSubEnvs(OwnSubEnvs):
    def __init__(self, num_envs, length=5):
        raise RuntimeError("no sub-environments today")


class SlowCounting(Counting):
    def __init__(self):
        super().__init__(seconds=0.001)


gymnasium.register("faultyOwnSubEnvs-v0", entry_point=Counting, vector_entry_point=OwnSubEnvs)
gymnasium.register("faultyHasNoSubEnvs-v0", entry_point=Counting, vector_entry_point=HasNoSubEnvs)


def chosen(client, env_id="CartPole-v1", **fields):
    answer = client.post("/v1/envs/", json={"env_id": env_id, "num_envs": 2, **fields})
    assert answer.status_code == 200, answer.json
    about = client.get(f"/v1/envs/{answer.json['instance_id']}").json
    return about["vectorization_mode"], about["autoreset_mode"]


def refused(client, status=400, env_id="CartPole-v1", **fields):
    answer = client.post("/v1/envs/", json={"env_id": env_id, "num_envs": 2, **fields})
    assert answer.status_code == status, answer.json
    assert client.get("/v1/envs/").json == {"all_envs": {}}
    return answer.json


def test_an_environments_own_implementation_is_the_fastest(client):
    assert chosen(client) == ("vector_entry_point", "NextStep")
    assert chosen(client, "Pendulum-v1") == ("sync", "NextStep")
    assert chosen(client, kwargs={"sutton_barto_reward": True})[0] == "vector_entry_point"
    assert chosen(client, seed=3, render_mode="human")[0] == "vector_entry_point"


WHAT_IT_CANNOT = [
    {"wrappers": [{"name": "TimeLimit", "kwargs": {"max_episode_steps": 5}}]},
    {"autoreset_mode": "SameStep"},
    {"autoreset_mode": "Disabled"},
    {"seed": [1, 2]},
    {"kwargs": {"max_episode_steps": -1}},
    {"kwargs": {"max_episode_steps": None}},
    {"kwargs": {"disable_env_checker": True}},
]


@pytest.mark.parametrize("fields", WHAT_IT_CANNOT)
def test_what_it_cannot_do_others_do(client, fields):
    mode = chosen(client, **fields)
    assert mode == ("sync", fields.get("autoreset_mode", "NextStep"))


@pytest.mark.parametrize("fields", WHAT_IT_CANNOT)
def test_what_it_cannot_do_is_refused_when_it_was_asked_for(client, fields):
    refusal = refused(client, vectorization_mode="vector_entry_point", **fields)
    assert refusal["code"] == "not_supported"
    assert "'vector_entry_point' is not possible: " in refusal["message"]
    assert "'sync'" in refusal["hint"]


def test_an_environment_without_an_own_implementation_says_so(client):
    refusal = refused(client, env_id="Pendulum-v1", vectorization_mode="vector_entry_point")
    assert refusal["message"].endswith("Pendulum-v1 has none")


def test_an_implementation_that_nobody_knows_is_taken_only_when_asked_for(client):
    own = {"env_id": "faultyOwnSubEnvs-v0", "autoreset_mode": "same_step"}
    before = OwnSubEnvs.made
    assert chosen(client, **own) == ("sync", "SameStep")
    assert OwnSubEnvs.made == before
    mode = "vector_entry_point"
    assert chosen(client, **own, vectorization_mode=mode) == (mode, "SameStep")
    assert OwnSubEnvs.made == before + 1


def test_an_implementation_that_fails_says_why(client):
    refusal = refused(
        client,
        status=500,
        env_id="faultyHasNoSubEnvs-v0",
        vectorization_mode="vector_entry_point",
    )
    assert refusal["message"] == "The environment raised RuntimeError: no sub-environments today"


@pytest.mark.parametrize(
    "mode", ["vector_entry_point", "sync", "async", "SYNC", "VectorEntryPoint"]
)
def test_an_implementation_can_be_asked_for(client, mode):
    letters = mode.lower().replace("_", "")
    assert chosen(client, vectorization_mode=mode)[0].replace("_", "") == letters


@pytest.mark.parametrize(
    ("mode", "meant"),
    [("next_step", "NextStep"), ("SAMESTEP", "SameStep"), ("Same_Step", "SameStep"),
     ("disabled", "Disabled")],
)  # fmt: skip
def test_case_and_underscores_do_not_matter_in_an_autoreset_mode(client, mode, meant):
    assert chosen(client, autoreset_mode=mode)[1] == meant


@pytest.mark.parametrize(
    ("field", "value", "wanted"),
    [
        ("num_envs", 0, "an integer, 1 or greater"),
        ("num_envs", -1, "an integer, 1 or greater"),
        ("num_envs", 1.5, "an integer, 1 or greater"),
        ("num_envs", "4", "an integer, 1 or greater"),
        ("num_envs", True, "an integer, 1 or greater"),
        ("num_envs", [4], "an integer, 1 or greater"),
        ("vectorization_mode", "fast", "one of vector_entry_point, sync, async"),
        ("vectorization_mode", 1, "one of vector_entry_point, sync, async"),
        ("autoreset_mode", "never", "one of NextStep, SameStep, Disabled"),
        (
            "seed",
            [1, -1],
            "an integer, 0 or greater, or a list of one, or null, for each sub-environment",
        ),
        ("seed", [1, 2, 3], "hold one integer or null for each of the 2 sub-environments, not 3"),
    ],
)
def test_what_cannot_be_meant_is_refused_and_named(client, field, value, wanted):
    refusal = refused(client, **{field: value})
    assert refusal["code"] == "invalid_parameter"
    assert f"'{field}' must " in refusal["message"]
    assert wanted in refusal["message"]


@pytest.mark.parametrize(
    "fields", [{"vectorization_mode": "sync"}, {"autoreset_mode": "NextStep"}, {"seed": [1]}]
)
def test_what_is_for_sub_envs_needs_sub_envs(client, fields):
    refusal = refused(client, num_envs=None, **fields)
    assert refusal["code"] == "invalid_parameter"
    assert "'num_envs' was not provided" in refusal["message"]
    assert next(iter(fields)) in refusal["message"]


@pytest.fixture
def small_server():
    app = create_app(Config(limits=Limits(max_num_envs=100)))
    yield app.test_client()
    app.close()


def test_a_server_has_a_largest_number_of_sub_envs(small_server):
    assert chosen(small_server, num_envs=100)[0] == "vector_entry_point"
    answer = small_server.post("/v1/envs/", json={"env_id": "CartPole-v1", "num_envs": 101})
    assert (answer.status_code, answer.json["code"]) == (429, "too_many_sub_envs")
    assert answer.json["message"] == "This server allows at most 100 sub-environments, not 101"


def test_there_is_a_largest_number_by_default(client):
    refusal = refused(client, 429, num_envs=100_001)
    assert refusal["message"] == "This server allows at most 100000 sub-environments, not 100001"


@pytest.mark.parametrize("mode", ["sync", "async"])
@pytest.mark.parametrize(
    ("env_id", "fields", "code"),
    [
        ("CartPol-v1", {}, "unknown_env_id"),
        ("this:X-v0", {}, "module_not_allowed"),
        ("CartPole-v1", {"kwargs": {"colour": 1}}, "invalid_kwargs"),
        ("CartPole-v1", {"kwargs": {"render_mode": "x"}}, "invalid_kwargs"),
        ("CartPole-v1", {"render_mode": "ansi"}, "invalid_parameter"),
        ("CartPole-v1", {"wrappers": [{"name": "Nope"}]}, "wrapper_not_allowed"),
        ("CartPole-v1", {"wrappers": [{"name": "TimeLimit"}]}, "invalid_kwargs"),
        ("faulty_envs:CustomSpace-v0", {}, "unsupported_space"),
        ("faulty_envs:LongDouble-v0", {}, "unsupported_space"),
    ],
)
def test_what_no_environment_can_have_no_sub_env_can(client, mode, env_id, fields, code):
    assert refused(client, env_id=env_id, vectorization_mode=mode, **fields)["code"] == code


@pytest.mark.parametrize("mode", [None, "sync", "async"])
def test_an_environment_that_cannot_be_made_says_why(client, mode):
    refusal = refused(client, 500, "faulty_envs:RaisesInConstructor-v0", vectorization_mode=mode)
    assert refusal["message"] == "The environment raised RuntimeError: no such table"


def test_arguments_cannot_change_what_was_chosen(client):
    for name in ("num_envs", "vectorization_mode", "vector_kwargs", "wrappers"):
        assert refused(client, kwargs={name: 3})["code"] == "invalid_kwargs"


def test_the_number_that_was_asked_for_counts_and_not_the_registered_one(client, monkeypatch):
    spec = EnvSpec(
        "Registered-v0",
        entry_point=CartPoleEnv,
        vector_entry_point=CartPoleVectorEnv,
        max_episode_steps=9,
        kwargs={"num_envs": 4},
    )
    monkeypatch.setitem(gymnasium.registry, "Registered-v0", spec)
    for mode in ("vector_entry_point", "sync"):
        fields = {"env_id": "Registered-v0", "num_envs": 2, "vectorization_mode": mode}
        url = f"/v1/envs/{client.post('/v1/envs/', json=fields).json['instance_id']}"
        assert len(client.post(f"{url}/reset/").json["observation"]) == 2


def test_an_implementation_that_makes_another_number_is_refused(client, monkeypatch):
    four = EnvSpec("Four-v0", vector_entry_point=lambda num_envs: OwnSubEnvs(4))
    monkeypatch.setitem(gymnasium.registry, "Four-v0", four)
    refusal = refused(client, env_id="Four-v0", autoreset_mode="SameStep")
    assert refusal["message"].endswith("it makes 4 sub-environments, not 2")


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"autoreset_mode": "Disabled"}, "its autoreset_mode cannot be Disabled"),
        ({"seed": 2**31 - 1}, "its seeds must be below 2147483648"),
        ({"seed": [1, 2**31]}, "its seeds must be below 2147483648"),
        ({"kwargs": {"max_episode_steps": 9}}, "unexpected keyword argument 'max_episode_steps'"),
    ],
)
def test_what_atari_cannot_do_is_said(client, fields, words):
    pytest.importorskip("ale_py")
    mode = "vector_entry_point"
    refusal = refused(client, env_id="ALE/Pong-v5", vectorization_mode=mode, **fields)
    assert (refusal["code"], words in refusal["message"]) == ("not_supported", True)


# How many processes ---------------------------------------------------------------------------


def about(client, env_id="Acrobot-v1", **fields):
    answer = client.post("/v1/envs/", json={"env_id": env_id, **fields})
    assert answer.status_code == 200, answer.json
    return client.get(f"/v1/envs/{answer.json['instance_id']}").json


@pytest.mark.parametrize(
    ("fields", "mode", "num_workers"),
    [
        ({"num_envs": 2, "num_workers": 0}, "sync", 0),
        ({"num_envs": 2, "num_workers": 2}, "async", 2),
        ({"num_envs": 100, "num_workers": 1}, "async", 1),
        ({"num_envs": 3, "vectorization_mode": "async"}, "async", 3),
        ({"num_envs": 100, "vectorization_mode": "async"}, "async", 4),
        ({"num_envs": 100, "vectorization_mode": "async", "num_workers": 2}, "async", 2),
        ({"num_envs": 16}, "sync", 0),
        ({"num_envs": 48}, "async", 2),
        ({"num_envs": 128}, "async", 4),
        ({"num_envs": 128, "vectorization_mode": "sync"}, "sync", 0),
        ({"num_envs": None}, None, None),
        ({"env_id": "CartPole-v1", "num_envs": 128}, "vector_entry_point", None),
        ({"env_id": "CartPole-v1", "num_envs": 2, "num_workers": 0}, "sync", 0),
        # Its steps take 5 us.
        ({"env_id": "FrozenLake-v1", "num_envs": 64}, "sync", 0),
        # Its steps are measured.
        (
            {"env_id": "faulty_envs:Counting-v0", "num_envs": 64, "kwargs": {"seconds": 0.001}},
            "async",
            4,
        ),
    ],
)
def test_processes_are_used_where_they_pay(client, monkeypatch, fields, mode, num_workers):
    monkeypatch.setattr("gym_server.vector_envs.num_workers.usable_cores", lambda: 4)
    found = about(client, **fields)
    assert (found["vectorization_mode"], found["num_workers"]) == (mode, num_workers)


@pytest.mark.parametrize(
    ("fields", "wanted"),
    [
        ({"num_workers": -1}, "must be an integer, 0 or greater, not -1"),
        ({"num_workers": 1.5}, "must be an integer, 0 or greater, not 1.5"),
        ({"num_workers": 3}, "must be at most 2, the number of sub-environments, not 3"),
        ({"num_workers": 1, "vectorization_mode": "sync"}, "must be 0 with vectorization_mode"),
        ({"num_workers": 0, "vectorization_mode": "async"}, "at least 1 with 'async', and"),
        (
            {"num_workers": 1, "vectorization_mode": "vector_entry_point"},
            "and left out with",
        ),
        ({"num_workers": 1, "num_envs": None}, "The parameter 'num_workers' is for vector env"),
    ],
)
def test_a_number_of_processes_that_cannot_be_is_refused(client, fields, wanted):
    refusal = refused(client, **fields)
    assert refusal["code"] == "invalid_parameter"
    assert wanted in refusal["message"]


@pytest.mark.parametrize(
    ("env_id", "why"),
    [
        ("faulty_envs:RaisesElsewhere-v0", "The environment raised RuntimeError: not here"),
        # Only this process knows its class.
        ("faultyLocal-v0", "pickle"),
        ("faultyUnread-v0", "known_here"),
    ],
)
def test_what_cannot_be_made_in_another_process_runs_in_this_one(client, monkeypatch, env_id, why):
    monkeypatch.setattr("gym_server.vector_envs.num_workers.usable_cores", lambda: 4)
    gymnasium.register("faultyLocal-v0", entry_point=lambda: Counting(seconds=0.001))
    # A name can be sent, even if it means nothing there.
    known_here = types.ModuleType("known_here")
    known_here.Slow = type("Slow", (SlowCounting,), {"__module__": "known_here"})
    monkeypatch.setitem(sys.modules, "known_here", known_here)
    gymnasium.register("faultyUnread-v0", entry_point=known_here.Slow)
    try:
        found = about(client, env_id, num_envs=64)
        assert (found["vectorization_mode"], found["num_workers"]) == ("sync", 0)
        answer = client.post("/v1/envs/", json={"env_id": env_id, "num_envs": 64, "num_workers": 2})
        assert (answer.status_code, answer.json["code"]) == (400, "not_supported")
        assert "cannot be made in another process: " in answer.json["message"]
        assert why in answer.json["message"]
        assert "num_workers 0" in answer.json["hint"]
    finally:
        del gymnasium.registry["faultyLocal-v0"], gymnasium.registry["faultyUnread-v0"]
