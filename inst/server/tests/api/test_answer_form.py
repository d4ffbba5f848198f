"""What a client can ask of the responses to reset, step and render: infos, tensors by column."""

import json

import gymnasium
import numpy as np
import pytest

from gym_server import spaces
from gym_server.protocol import safetensors
from gym_server.protocol.safetensors import COLUMN_TENSORS, TENSORS

COLUMNS = {"Accept": COLUMN_TENSORS}
ROWS = {"Accept": TENSORS}


def read_tensors(answer):
    assert answer.content_type in (TENSORS, COLUMN_TENSORS)
    return safetensors.read(answer.data)


def arrays(answer):
    """Return the tensors of a response in Python's order, whatever the order in the file."""
    by_column = answer.content_type == COLUMN_TENSORS
    tensors = {name: part.array() for name, part in read_tensors(answer).tensors.items()}
    return {name: array.T if by_column else array for name, array in tensors.items()}


def pair(create, *arguments, **fields):
    """Return two instances that play the same."""
    return [create(*arguments, **fields) for _ in range(2)]


@pytest.mark.parametrize("autoreset_mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("kind", ["Box", "Dict", "Tuple", "MultiBinary", "Discrete"])
def test_tensors_by_column_are_those_by_row_transposed(client, sub_envs, kind, autoreset_mode):
    how = {"autoreset_mode": autoreset_mode, "vectorization_mode": "sync"}
    one, other = sub_envs(kind, **how), sub_envs(kind, **how)
    by_row = client.post(f"{one}/reset/", json={"seed": 1}, headers=ROWS)
    by_column = client.post(f"{other}/reset/", json={"seed": 1}, headers=COLUMNS)
    names = set()
    for _ in range(6):
        assert by_column.content_type == COLUMN_TENSORS
        expected, found = arrays(by_row), arrays(by_column)
        assert expected.keys() == found.keys()
        for name, array in expected.items():
            assert np.array_equal(array, found[name], equal_nan=array.dtype.kind == "f"), name
        assert read_tensors(by_row).metadata == read_tensors(by_column).metadata
        names |= expected.keys()
        action = client.get(f"{one}/action_space/sample").json["action"]
        by_row = client.post(f"{one}/step/", json={"action": action}, headers=ROWS)
        by_column = client.post(f"{other}/step/", json={"action": action}, headers=COLUMNS)
    ended = any(name.partition("/")[0] == "final_obs" for name in names)
    assert ended is (autoreset_mode == "SameStep")


def test_the_bytes_by_column_are_in_rs_order(client, create):
    observation, _ = gymnasium.make_vec("CartPole-v1", num_envs=3).reset(seed=2)
    url = create(num_envs=3)
    file = read_tensors(client.post(f"{url}/reset/", json={"seed": 2}, headers=COLUMNS))
    tensor = file.tensors["observation"]
    assert tensor.shape == (4, 3)
    assert bytes(tensor.data) == observation.tobytes("F")


def test_a_single_observation_of_one_dimension_is_the_same_by_column(client, create):
    one, other = pair(create)
    by_row = client.post(f"{one}/reset/", json={"seed": 2}, headers=ROWS)
    by_column = client.post(f"{other}/reset/", json={"seed": 2}, headers=COLUMNS)
    assert by_row.data == by_column.data


def test_a_frame_by_column_has_its_width_before_its_height(client, create):
    url = create(render_mode="rgb_array")
    client.post(f"{url}/reset/", json={"seed": 1})
    by_row = client.get(f"{url}/render/", headers=ROWS)
    by_column = client.get(f"{url}/render/", headers=COLUMNS)
    assert by_column.content_type == COLUMN_TENSORS
    assert read_tensors(by_row).tensors["frame"].shape == (400, 600, 3)
    assert read_tensors(by_column).tensors["frame"].shape == (3, 600, 400)
    assert np.array_equal(arrays(by_row)["frame"], arrays(by_column)["frame"])


@pytest.mark.parametrize(
    "accept, content_type",
    [
        (f"{TENSORS};order=column", COLUMN_TENSORS),
        (f'{TENSORS}; order="column"', COLUMN_TENSORS),
        (f"{COLUMN_TENSORS}, {TENSORS};q=0.9, application/json;q=0.5", COLUMN_TENSORS),
        (f"{COLUMN_TENSORS};q=0.5, {TENSORS}", TENSORS),
        (f"{TENSORS}, application/*;q=0.5", TENSORS),
        (f"{TENSORS};q=0.5, application/json", "application/json"),
        (f"{TENSORS}; order=row", "application/json"),
        ("*/*", "application/json"),
    ],
)
def test_the_order_is_one_that_the_client_accepts(client, create, accept, content_type):
    url = create(num_envs=2)
    answer = client.post(f"{url}/reset/", json={}, headers={"Accept": accept})
    assert answer.content_type == content_type


def test_a_space_that_travels_as_json_only_does_so_by_column_too(client, sub_envs):
    url = sub_envs("Sequence", vectorization_mode="sync")
    answer = client.post(f"{url}/reset/", json={}, headers=COLUMNS)
    assert answer.content_type == "application/json"


def test_the_order_is_a_part_of_what_a_repetition_asks(client, create):
    url = create(num_envs=2)
    body = {"seed": 1, "request": {"key": "a", "number": 1}}
    first, again = (client.post(f"{url}/reset/", json=body, headers=COLUMNS) for _ in range(2))
    assert (first.data, first.content_type) == (again.data, again.content_type)
    other = client.post(f"{url}/reset/", json=body, headers=ROWS)
    assert other.json["code"] == "request_conflict"


# Infos ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("info", [False, "false", 0])
def test_infos_that_are_not_wanted_are_empty(client, sub_envs, info):
    url = sub_envs(vectorization_mode="sync")
    assert client.post(f"{url}/reset/", json={"info": info}).json["info"] == {}
    action = client.get(f"{url}/action_space/sample").json["action"]
    body = {"action": action, "info": info}
    assert client.post(f"{url}/step/", json=body).json["info"] == {}
    file = read_tensors(client.post(f"{url}/step/", json=body, headers=ROWS))
    assert file.metadata["info"] == "{}"


@pytest.mark.parametrize("fields", [{}, {"info": True}, {"info": None}, {"info": ""}])
def test_infos_come_unless_they_are_refused(client, sub_envs, fields):
    url = sub_envs(vectorization_mode="sync")
    assert client.post(f"{url}/reset/", json=fields).json["info"]
    action = client.get(f"{url}/action_space/sample").json["action"]
    assert client.post(f"{url}/step/", json={"action": action, **fields}).json["info"]


def test_a_single_environment_leaves_its_info_out_too(client, create):
    url = create("Blackjack-v1", wrappers=[{"name": "RecordEpisodeStatistics"}])
    client.post(f"{url}/reset/", json={"seed": 1})
    assert client.post(f"{url}/step/", json={"action": 0, "info": False}).json["info"] == {}
    client.post(f"{url}/reset/", json={"seed": 1})
    assert "episode" in client.post(f"{url}/step/", json={"action": 0}).json["info"]


def test_last_observations_come_without_infos(client, sub_envs):
    url = sub_envs(autoreset_mode="SameStep", vectorization_mode="sync", longest=1)
    client.post(f"{url}/reset/", json={"seed": 1})
    action = client.get(f"{url}/action_space/sample").json["action"]
    answer = client.post(f"{url}/step/", json={"action": action, "info": False}).json
    assert (answer["info"], answer["final_sub_envs"]) == ({}, [0, 1, 2])
    assert len(answer["final_obs"]) == 3


@pytest.mark.parametrize("wanted", [True, False])
def test_tensors_can_be_sent_with_the_wish_for_no_last_observations(client, create, wanted):
    url = create(num_envs=2, autoreset_mode="SameStep", kwargs={"max_episode_steps": 1})
    client.post(f"{url}/reset/", json={"seed": 1})
    parts = spaces.tensor_writer(
        gymnasium.make("CartPole-v1").action_space, "action", is_batch=True
    )
    answer = client.post(
        f"{url}/step/",
        data=safetensors.write(parts(np.array([0, 1])).tensors, {"final_obs": json.dumps(wanted)}),
        headers={"Content-Type": TENSORS},
    )
    assert ("final_obs" in answer.json) is wanted


def test_tensors_can_be_sent_with_the_wish_for_no_infos(client, create):
    url = create(num_envs=2, vectorization_mode="sync")
    client.post(f"{url}/reset/", json={"seed": 1})
    space = gymnasium.make("CartPole-v1").action_space
    parts = spaces.tensor_writer(space, "action", is_batch=True)(np.array([0, 1]))
    for info, status in (("false", 200), ("3", 400)):
        answer = client.post(
            f"{url}/step/",
            data=safetensors.write(parts.tensors, {"info": info}),
            headers={"Content-Type": TENSORS},
        )
        assert answer.status_code == status
    assert answer.json["code"] == "invalid_parameter"
    assert "'info'" in json.loads(answer.data)["message"]
