"""Box actions out of bounds are passed to the environment, as in Gymnasium."""

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Dict, Discrete, Graph, MultiBinary, OneOf, Sequence, Tuple

from gym_server import spaces
from gym_server.errors import GymServerError
from gym_server.instances.actions import ActionReader
from gym_server.protocol import safetensors
from gym_server.protocol.safetensors import TENSORS, Tensor

# Actions of an unclipped Gaussian policy, and the float32 next to a bound.
OUTSIDE = [2.5, -2.000000238, 1e30, -7.0]


def step(client, url, **fields):
    return client.post(f"{url}/step/", json=fields)


def step_tensors(client, url, action):
    return client.post(
        f"{url}/step/",
        data=safetensors.write({"action": Tensor.of(np.asarray(action))}, {}),
        headers={"Content-Type": TENSORS},
    )


def in_process(actions):
    env = gymnasium.make("Pendulum-v1")
    env.reset(seed=1)
    return [env.step(np.array([action], np.float32))[:2] for action in actions]


def test_pendulum_moves_as_in_process(client, create):
    for send in (
        lambda url, action: step(client, url, action=[action]),
        lambda url, action: step_tensors(client, url, np.array([action], np.float32)),
    ):
        url = create("Pendulum-v1")
        client.post(f"{url}/reset/", json={"seed": 1})
        for action, (observation, reward) in zip(OUTSIDE, in_process(OUTSIDE), strict=True):
            answer = send(url, action)
            assert answer.status_code == 200, answer.json
            assert answer.json["observation"] == observation.tolist()
            assert answer.json["reward"] == float(reward)


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_so_do_its_sub_envs(client, create, mode):
    for as_tensors in (False, True):
        url = create("Pendulum-v1", num_envs=2, vectorization_mode=mode)
        client.post(f"{url}/reset/", json={"seed": [1, 1]})
        for action, (observation, _) in zip(OUTSIDE, in_process(OUTSIDE), strict=True):
            actions = [[action], [action]]
            if as_tensors:
                answer = step_tensors(client, url, np.array(actions, np.float32))
            else:
                answer = step(client, url, action=actions)
            assert answer.status_code == 200, answer.json
            assert answer.json["observation"] == [observation.tolist()] * 2
        client.post(f"{url}/close/")


@pytest.mark.parametrize(
    ("action", "shown"),
    [
        (["NaN"], '"NaN"'),
        (["Infinity"], '"Infinity"'),
        (["-Infinity"], '"-Infinity"'),
        ([1e39], "1e+39"),
        ([True], "true"),
        (["2.5"], '"2.5"'),
        ([2.5, 2.5], "[2.5, 2.5]"),
    ],
)
def test_what_is_no_number_of_the_dtype_is_refused(client, create, action, shown):
    url = create("Pendulum-v1")
    before = client.post(f"{url}/reset/", json={"seed": 1}).json["observation"]
    answer = step(client, url, action=action)
    assert (answer.status_code, answer.json["code"]) == (400, "action_not_in_space")
    assert shown in answer.json["message"]
    assert "is not in Box(-2.0, 2.0, (1,), float32)" in answer.json["message"]
    assert client.get(url).json["episode_steps"] == 0
    assert client.post(f"{url}/reset/", json={"seed": 1}).json["observation"] == before


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_nor_do_tensors_carry_what_is_not_finite(client, create, value):
    url = create("Pendulum-v1")
    client.post(f"{url}/reset/")
    answer = step_tensors(client, url, np.array([value], np.float32))
    assert (answer.status_code, answer.json["code"]) == (400, "action_not_in_space")


UNIT = Box(0, 1, (1,), np.float32)


@pytest.mark.parametrize(
    ("space", "action"),
    [
        (UNIT, [-3.5]),
        (Box(0, 1, (1,), np.float16), [65504]),
        (Box(3, 254, (2,), np.uint8), [0, 255]),
        (Box(-5, 5, (1,), np.int64), [2**62]),
        (Box(np.array([-np.inf, 0]), np.array([0, 1]), dtype=np.float64), ["-Infinity", 1e300]),
        (Tuple([Discrete(2), UNIT]), [1, [2.5]]),
        (Dict(a=Tuple([UNIT])), {"a": [[2.5]]}),
        (Sequence(UNIT), [[2.5], [-1]]),
        (Sequence(UNIT, stack=True), [[2.5], [-1]]),
        (OneOf([Discrete(2), UNIT]), [1, [2.5]]),
        (Graph(UNIT, UNIT), {"nodes": [[2.5]], "edges": [[9]], "edge_links": [[0, 0]]}),
        (Graph(UNIT, None), {"nodes": [[2.5]]}),
    ],
    ids=str,
)
def test_boxes_inside_of_other_spaces_are_as_wide(space, action):
    assert not space.contains(spaces.decode(space, action))


@pytest.mark.parametrize(
    ("space", "action"),
    [
        (Box(0, 1, (1,), np.float16), [65520]),
        (Box(3, 254, (2,), np.uint8), [3, 256]),
        (Box(3, 254, (2,), np.uint8), [3, -1]),
        (Box(3, 254, (2,), np.uint8), [3, 3.5]),
        (Box(-5, 5, (1,), np.int64), [2**63]),
        (Box(0, 1, (1,), bool), [2]),
        (Box(np.array([-np.inf, 0]), np.array([0, 1]), dtype=np.float64), ["Infinity", 1]),
        (Box(-np.inf, np.inf, (1,), np.float64), ["NaN"]),
        (MultiBinary(1), [2]),
        (Tuple([Discrete(2), UNIT]), [2, [0.5]]),
    ],
    ids=str,
)
def test_everything_else_is_asked_for_as_ever(space, action):
    with pytest.raises(spaces.NotInSpace):
        spaces.decode(space, action)


def test_contains_goes_on_asking_for_members(client, create):
    url = create("Pendulum-v1")
    for value, member in (([2.5], False), ([2.0], True)):
        asked = client.post(f"{url}/action_space/contains/", json={"value": value})
        assert asked.json == {"member": member}


@pytest.mark.parametrize("fields", [{}, {"num_envs": 2, "vectorization_mode": "sync"}])
def test_an_environment_that_refuses_it_itself_gets_a_hint(client, create, fields):
    url = create("faulty_envs:Insists-v0", kwargs={"space": "half", "longest": 99}, **fields)
    client.post(f"{url}/reset/", json={"seed": 1})
    action = [[0.5], [7.5]] if fields else [7.5]
    answer = step(client, url, action=action)
    assert (answer.status_code, answer.json["code"]) == (500, "environment_error")
    assert "AssertionError: no action" in answer.json["message"]
    assert 'gym_wrap(..., "ClipAction")' in answer.json["hint"]


def test_a_failure_of_another_kind_gets_none(client, create):
    url = create("faulty_envs:Insists-v0", kwargs={"space": "half", "longest": 1})
    client.post(f"{url}/reset/")
    answer = step(client, url, action=0.5)
    assert "too late" in answer.json["message"]
    assert "hint" not in answer.json


def test_the_wrapper_of_the_hint_helps(client, create):
    url = create("Pendulum-v1", wrappers=[{"name": "ClipAction"}])
    client.post(f"{url}/reset/", json={"seed": 1})
    observation = in_process([2.0])[0][0]
    assert step(client, url, action=[2.5]).json["observation"] == observation.tolist()


@pytest.mark.parametrize(
    ("space", "hint"),
    [
        (Discrete(2), "actions are 0 and 1, counted from 0"),
        (Discrete(6), "actions are 0 to 5, counted from 0"),
        (Discrete(2, start=3), "actions are 3 and 4"),
        (Discrete(1), "the only action is 0"),
        (Box(-1, 1), None),
    ],
    ids=str,
)
def test_a_refusal_says_which_actions_there_are(space, hint):
    with pytest.raises(GymServerError) as caught:
        ActionReader(space, 1).read("nonsense")
    assert (caught.value.code, caught.value.hint) == ("action_not_in_space", hint)
