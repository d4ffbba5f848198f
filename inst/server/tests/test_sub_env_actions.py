import numpy as np
import pytest
from vector_play import (
    action_file,
    actions_of,
    check_that_no_sub_env_moved,
    post,
    refusal,
    twin,
)

from gym_server import spaces
from gym_server.json_values import plain
from gym_server.protocol import safetensors
from gym_server.protocol.safetensors import TENSORS, Tensor
from gym_server.spaces.stacking import stack


@pytest.mark.parametrize(
    ("kind", "action", "words"),
    [
        ("Discrete", [0, 0], "for each of the 3 sub-environments is needed, not 2"),
        ("Discrete", 0, "for each of the 3 sub-environments is needed, as a list"),
        ("Discrete", [0, 7, 0], "7 at [1] is not in Discrete(5, start=-2)"),
        ("Discrete", [0, None, 0], "null at [1] is not in Discrete"),
        ("Discrete", [0, 0, 0.5], "0.5 at [2] is not in Discrete"),
        ("bytes", [[0] * 4, [0] * 4, [0, 0, 300, 0]], "300 at [2][2] is not in Box"),
        ("bytes", [[0] * 4, [0] * 3, [0] * 4], "[0, 0, 0] at [1] is not in Box"),
        ("MultiBinary", [[0] * 4, [0] * 4, [0, 2, 0, 0]], "2 at [2]"),
        ("Text", ["a", "b", "z"], '"z" at [2] is not in Text'),
        ("Sequence", [[], [], [[0, "x"]]], '"x" at [2][0][1] is not in'),
    ],
)
def test_an_action_that_is_none_is_named_with_its_sub_env(client, sub_envs, kind, action, words):
    url = sub_envs(kind)
    post(client, url, "reset", seed=1)
    code, message = refusal(client, url, "step", action=action)
    assert code == "action_not_in_space"
    assert message.startswith("The action ")
    assert words in message
    check_that_no_sub_env_moved(client, url, kind, seed=1)


@pytest.mark.parametrize(
    ("kind", "tensor", "words"),
    [
        (
            "Discrete",
            np.array([0, 0], np.int64),
            "for each of the 3 sub-environments is needed, not 2",
        ),
        ("Discrete", np.array([0, 0, 7], np.int32), "7 at [2] is not in Discrete"),
        ("Discrete", np.array([0, 0, -3], np.int64), "-3 at [2] is not in Discrete"),
        ("Discrete", np.array([0, 0, 0], np.int16), "I64 [3] is needed"),
        ("Discrete", np.array(0), "I64 [3] is needed"),
        ("Discrete", np.zeros((3, 1), np.int64), "I64 [3] is needed"),
        ("Box", np.full((3, 2, 3), np.nan, np.float32), '"NaN" at [0][0][0]'),
        ("Box", np.zeros((3, 2, 3)), "F32 [3, 2, 3] is needed"),
        ("half", np.full((3, 1), np.inf, np.float16), '"Infinity" at [0][0]'),
    ],
)
def test_tensors_that_are_no_actions_are_named_with_their_sub_env(
    client, sub_envs, kind, tensor, words
):
    url = sub_envs(kind)
    post(client, url, "reset", seed=1)
    answer = client.post(
        f"{url}/step/",
        data=safetensors.write({"action": Tensor.of(tensor)}, {}),
        headers={"Content-Type": TENSORS},
    )
    assert (answer.status_code, answer.json["code"]) == (400, "action_not_in_space")
    assert words in answer.json["message"]
    check_that_no_sub_env_moved(client, url, kind, seed=1)


def test_the_sub_env_comes_first_in_the_path_to_what_is_wrong(client, sub_envs):
    url, env = sub_envs("Dict"), twin("Dict")
    post(client, url, "reset", seed=1)
    actions, _ = actions_of(env, 0)
    wrong = [dict(action) for action in actions]
    wrong[2]["a/b~"] = (wrong[2]["a/b~"][0], np.array([np.inf]))
    encoded = [plain(spaces.encode(env.single_action_space, action)) for action in wrong]
    in_json = refusal(client, url, "step", action=encoded)[1]
    answer = client.post(
        f"{url}/step/",
        data=action_file(env, stack(env.single_action_space, wrong)),
        headers={"Content-Type": TENSORS},
    )
    assert '"Infinity" at [2]$`a/b~`[1][0] is not in' in in_json
    assert answer.json["message"] == in_json
    check_that_no_sub_env_moved(client, url, "Dict", seed=1)


def test_an_action_space_that_holds_nothing_is_refused(client):
    body = {"env_id": "faulty_envs:Uneven-v0", "num_envs": 2, "kwargs": {"space": "nothing"}}
    answer = client.post("/v1/envs/", json=body)
    assert (answer.status_code, answer.json["code"]) == (400, "unsupported_space")
    assert "empty Tuple or Dict" in answer.json["hint"]
