"""Environments with a table of transitions return it as a model."""

import inspect

import gymnasium
import pytest
from faulty_envs.tables import STARTS, TABLES
from gymnasium.envs.toy_text.cliffwalking import CliffWalkingEnv
from gymnasium.envs.toy_text.frozen_lake import FrozenLakeEnv
from gymnasium.envs.toy_text.taxi import TaxiEnv

from gym_server.envs import wrappers

pytestmark = pytest.mark.slow

COLUMNS = ("state", "action", "next_state", "probability", "reward", "terminated")

CASES = [
    (FrozenLakeEnv, ["FrozenLake-v1", "FrozenLake8x8-v1"], {}),
    (FrozenLakeEnv, ["FrozenLake-v1"], {"map_name": "8x8"}),
    (FrozenLakeEnv, ["FrozenLake-v1"], {"is_slippery": False}),
    (FrozenLakeEnv, ["FrozenLake-v1"], {"desc": ["SFHS", "FFFG"]}),
    (FrozenLakeEnv, ["FrozenLake-v1"], {"success_rate": 0.7}),
    (FrozenLakeEnv, ["FrozenLake-v1"], {"success_rate": 1}),
    (FrozenLakeEnv, ["FrozenLake-v1"], {"reward_schedule": [10, -1.5, 0.1]}),
    (CliffWalkingEnv, ["CliffWalking-v0", "CliffWalking-v1", "CliffWalkingSlippery-v1"], {}),
    (CliffWalkingEnv, ["CliffWalking-v1"], {"is_slippery": True}),
    (TaxiEnv, ["Taxi-v3", "Taxi-v4"], {}),
    (TaxiEnv, ["Taxi-v3", "Taxi-v4"], {"is_rainy": True}),
    (TaxiEnv, ["Taxi-v4"], {"is_rainy": True, "rainy_probability": 0.1}),
    (TaxiEnv, ["Taxi-v4"], {"fickle_probability": 0.5}),
]
# Other versions of Gymnasium may lack an id or an argument.
MADE_HERE = [
    (env_id, kwargs)
    for kind, env_ids, kwargs in CASES
    for env_id in env_ids
    if env_id in gymnasium.registry and kwargs.keys() <= inspect.signature(kind).parameters.keys()
]


def of_gymnasium(env_id, kwargs):
    """Return the model of a Gymnasium environment, computed in the test."""
    env = gymnasium.make(env_id, **kwargs).unwrapped
    rows = [
        (state, action, next_state, probability, reward, terminated)
        for state in range(env.observation_space.n)
        for action in range(env.action_space.n)
        for probability, next_state, reward, terminated in env.P[state][action]
        if probability != 0
    ]
    return {
        "num_states": env.observation_space.n,
        "num_actions": env.action_space.n,
        "start": list(env.initial_state_distrib),
        **{name: [row[place] for row in rows] for place, name in enumerate(COLUMNS)},
    }


def refusal(client, url, status=400, code="not_supported"):
    answer = client.get(f"{url}/model/")
    assert (answer.status_code, answer.json["code"]) == (status, code)
    return answer.json


@pytest.mark.parametrize(("env_id", "kwargs"), MADE_HERE)
def test_a_model_is_the_table_of_gymnasium(client, create, env_id, kwargs):
    answer = client.get(f"{create(env_id, kwargs=kwargs)}/model/")
    assert answer.status_code == 200, answer.json
    # Exactly: JSON does not change a float.
    assert answer.json == {"model": of_gymnasium(env_id, kwargs)}


def test_the_arguments_of_this_gymnasium_are_tried():
    tried = [argument for _, kwargs in MADE_HERE for argument in kwargs]
    assert {"map_name", "is_slippery", "desc"} <= set(tried)
    assert {"FrozenLake-v1", "CliffWalking-v1"} <= {env_id for env_id, _ in MADE_HERE}


def test_to_ask_for_a_model_needs_no_reset_and_moves_nothing(client, create):
    url = create("FrozenLake-v1")
    before = client.get(f"{url}/model/").json
    client.post(f"{url}/reset/", json={"seed": 1})
    client.post(f"{url}/step/", json={"action": 2})
    assert client.get(f"{url}/model").json == before
    about = client.get(url).json
    assert (about["steps"], about["episode_steps"]) == (1, 1)


def test_numbers_are_those_of_the_table_and_impossible_transitions_are_left_out(client, faulty):
    model = client.get(f"{faulty('Table')}/model/").json["model"]
    assert model == {
        "num_states": 2,
        "num_actions": 2,
        "start": [0.25, 0.75],
        "state": [0, 0, 1, 1, 1],
        "action": [0, 1, 0, 1, 1],
        "next_state": [0, 0, 0, 0, 1],
        "probability": [1, 1, 1, 0.25, 0.75],
        "reward": [0, 0, 0, 1, -3.5],
        "terminated": [False, False, False, False, True],
    }
    model = client.get(f"{faulty('Table', P='of NumPy', start='a list')}/model/").json["model"]
    assert model["start"] == [0, 1]
    assert [model[name][3:] for name in COLUMNS[2:]] == [
        [1, 0],
        [0.5, 0.5],
        # The nearest 32-bit float, with all digits.
        [0.10000000149011612, -100],
        [True, False],
    ]
    assert {type(number) for name in COLUMNS[:3] for number in model[name]} == {int}


@pytest.mark.parametrize(
    ("env_id", "kwargs"),
    [
        ("CartPole-v1", {}),
        ("Blackjack-v1", {}),
        ("faulty_envs:Table-v0", {"P": "a number"}),
        ("faulty_envs:Table-v0", {"start": "none"}),
        ("faulty_envs:Table-v0", {"first": 1}),
        ("faulty_envs:Table-v0", {"box": True}),
    ],
)
def test_an_environment_without_a_table_says_so(client, create, env_id, kwargs):
    said = refusal(client, create(env_id, kwargs=kwargs))
    assert said["message"] == f"{env_id} has no table of its transitions"
    assert "FrozenLake, CliffWalking and Taxi have one" in said["hint"]


@pytest.mark.parametrize("env_id", ["FrozenLake-v1", "CartPole-v1"])
@pytest.mark.parametrize("num_envs", [1, 3])
def test_sub_environments_have_no_model_together(client, create, env_id, num_envs):
    said = refusal(client, create(env_id, num_envs=num_envs))
    assert said["message"].startswith(f"{env_id} has sub-environments here")
    assert said["hint"] == "create it without num_envs"


@pytest.mark.parametrize(
    ("name", "kwargs"),
    [
        ("ClipReward", {"min_reward": 0, "max_reward": 0.5}),
        ("DelayObservation", {"delay": 1}),
        ("FlattenObservation", {}),
        ("NormalizeReward", {}),
        ("RepeatAction", {"num_repeats": 2}),
        ("StickyAction", {"repeat_action_probability": 0.5}),
        ("TimeAwareObservation", {}),
    ],
)
def test_a_wrapper_that_changes_something_is_named(client, create, name, kwargs):
    if name not in wrappers.allowed():
        pytest.skip("this Gymnasium has no such wrapper")
    around = {"name": "RecordEpisodeStatistics"}
    chosen = [{"name": name, "kwargs": kwargs}, around]
    said = refusal(client, create("FrozenLake-v1", wrappers=chosen))
    assert said["message"] == (
        f"The transition table of FrozenLake-v1 is wrong with its wrapper {name}"
    )
    assert "create it without this wrapper" in said["hint"]


def test_a_wrapper_that_derives_from_a_harmless_one_is_not_harmless(client, create):
    said = refusal(client, create("faulty_envs:LooksTimed-v0"))
    assert "wrapper _TimeLimit" in said["message"]


def test_wrappers_that_change_nothing_may_stay(client, create):
    plain = client.get(f"{create('FrozenLake-v1')}/model/").json
    chosen = [
        {"name": "TimeLimit", "kwargs": {"max_episode_steps": 7}},
        {"name": "RecordEpisodeStatistics"},
    ]
    kwargs = {"disable_env_checker": False}
    url = create("FrozenLake-v1", wrappers=chosen, kwargs=kwargs)
    assert client.get(f"{url}/model/").json == plain


@pytest.mark.skipif(
    "fickle_passenger" not in inspect.signature(TaxiEnv).parameters,
    reason="this Gymnasium's Taxi has no such argument",
)
def test_a_table_that_leaves_something_out_is_refused(client, create):
    said = refusal(client, create("Taxi-v4", kwargs={"fickle_passenger": True}))
    assert said["message"] == ("The transition table of Taxi-v4 is wrong with fickle_passenger")
    assert said["hint"] == "create it without fickle_passenger"


# Tables that are sent; clients find that the probabilities do not add up to 1.
SENT = {"sound", "of NumPy", "a number", "a list"} | {
    "half a probability",
    "two probabilities",
}


@pytest.mark.parametrize("name", sorted(TABLES.keys() - SENT))
def test_an_unsound_table_is_refused_with_its_place(client, faulty, name):
    said = refusal(client, faulty("Table", P=name))
    beginning = "The transition table of faulty_envs:Table-v0 is invalid: "
    assert said["message"].startswith(beginning)
    place = "P[0][0]" if name in ("nothing", "names") else "P[1]["
    assert place in said["message"]
    assert "(probability, next_state, reward, terminated)" in said["hint"]


@pytest.mark.parametrize("name", sorted(STARTS.keys() - SENT))
def test_an_unsound_beginning_is_refused(client, faulty, name):
    said = refusal(client, faulty("Table", start=name))
    assert "initial_state_distrib" in said["message"]


def test_words_say_what_is_unsound(client, create, faulty):
    said = refusal(client, faulty("Table", P="a state beyond the last"))["message"]
    assert said.endswith("is invalid: P[1][1] holds [1.0, 2, 0.0, false]")
    said = refusal(client, faulty("Table", start="too short"))["message"]
    assert "must hold a probability for each of the 2 states" in said
    if "success_rate" in inspect.signature(FrozenLakeEnv).parameters:
        lake = create("FrozenLake-v1", kwargs={"success_rate": 1.5})
        assert "P[0][0] holds [-0.25, 0, 0, false]" in refusal(client, lake)["message"]


def test_a_space_of_countless_states_takes_no_time(client, faulty):
    said = refusal(client, faulty("Table", n=2**62))
    assert f"each of the {2**62} states" in said["message"]


def test_a_table_that_cannot_be_read_is_the_environments_error(client, faulty):
    said = refusal(client, faulty("Table", P="raises"), 500, "environment_error")
    assert said["message"] == "The environment raised RuntimeError: the table is gone"


def test_a_closed_environment_has_no_model(client, create):
    url = create("FrozenLake-v1")
    client.post(f"{url}/close/")
    refusal(client, url, code="unknown_instance")
