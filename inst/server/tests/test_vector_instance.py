import json

import faulty_envs
import gymnasium
import numpy as np
import pytest
from vector_play import (
    ACCEPT,
    MODES,
    actions_of,
    apart,
    check_step,
    check_tensors,
    in_process,
    members,
    read_tensors,
)

from gym_server import spaces, tensors
from gym_server.plain import plain
from gym_server.spaces.stacking import stack, unstack
from gym_server.tensors import TENSORS, Tensor

KINDS = [kind for kind in faulty_envs.SPACES if kind != "nothing"]
IN_TENSORS = [kind for kind in KINDS if spaces.travels_as_tensors(faulty_envs.SPACES[kind])]


@pytest.fixture
def lanes(create):
    """Make a vector instance of the environment whose infos come and go."""

    def lanes(space="Box", num_envs=3, name="Uneven", longest=4, **fields):
        kwargs = {"space": space, "longest": longest}
        return create(f"faulty_envs:{name}-v0", num_envs=num_envs, kwargs=kwargs, **fields)

    return lanes


def twin(space="Box", num_envs=3, autoreset_mode="NextStep", longest=4):
    return in_process("Uneven-v0", num_envs, autoreset_mode, space=space, longest=longest)


def post(client, url, route, headers=None, **body):
    answer = client.post(f"{url}/{route}/", json=body, headers=headers)
    assert answer.status_code == 200, answer.json
    return answer.json if headers is None else read_tensors(answer)


def refusal(client, url, route, **body):
    answer = client.post(f"{url}/{route}/", json=body)
    assert answer.status_code == 400, answer.json
    return answer.json["code"], answer.json["message"]


def reset_those_that_ended(client, url, env, ended):
    """Reset them here and there, as the mode without autoreset wants it."""
    expected, info = env.reset(options={"reset_mask": np.array(ended)})
    answer = post(client, url, "reset", reset_mask=ended)
    space = env.single_observation_space
    assert apart(space, answer["observation"]) == members(env, expected)
    assert answer["info"] == plain(info)


# What comes is what Gymnasium has ------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", KINDS)
def test_lanes_in_json_are_those_of_gymnasium(client, lanes, kind, mode):
    check_play(client, lanes(kind, autoreset_mode=mode, vectorization_mode="sync"), kind, mode)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", ["Box", "Dict", "Sequence"])
def test_lanes_in_processes_are_those_of_gymnasium(client, lanes, kind, mode):
    check_play(client, lanes(kind, autoreset_mode=mode, vectorization_mode="async"), kind, mode)


def check_play(client, url, kind, mode, steps=12):
    env = twin(kind, autoreset_mode=mode)
    expected, info = env.reset(seed=7)
    answer = post(client, url, "reset", seed=7)
    space = env.single_observation_space
    assert apart(space, answer["observation"]) == members(env, expected)
    assert answer["info"] == plain(info)
    for step in range(steps):
        actions, batch = actions_of(env, step)
        encoded = [plain(spaces.encode(env.single_action_space, action)) for action in actions]
        answer = post(client, url, "step", action=encoded)
        check_step(env, answer, env.step(batch))
        if mode == "Disabled" and any(answer["done"]):
            reset_those_that_ended(client, url, env, answer["done"])
        if step == 7:
            # Also when an autoreset was to come.
            expected, _ = env.reset(seed=[3, None, 5])
            answer = post(client, url, "reset", seed=[3, None, 5])
            assert apart(space, answer["observation"]) == members(env, expected)
    assert client.get(url).json["steps"] == steps * 3


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", IN_TENSORS)
def test_lanes_in_tensors_are_those_of_gymnasium_byte_for_byte(client, lanes, kind, mode):
    url, env = lanes(kind, autoreset_mode=mode), twin(kind, autoreset_mode=mode)
    expected, _ = env.reset(seed=7)
    space = env.single_observation_space
    check_tensors(space, "observation", post(client, url, "reset", ACCEPT, seed=7), expected)
    for step in range(8):
        _, batch = actions_of(env, step)
        answer = client.post(
            f"{url}/step/",
            data=action_file(env, batch),
            headers={"Content-Type": TENSORS, **ACCEPT},
        )
        file = read_tensors(answer)
        observation, reward, terminated, truncated, info = env.step(batch)
        check_tensors(space, "observation", file, observation)
        for name, flags in (("reward", reward), ("terminated", terminated)):
            assert file.tensors[name].array().tobytes() == flags.tobytes()
        assert file.tensors["truncated"].array().tolist() == truncated.tolist()
        final, which = info.pop("final_obs", None), info.pop("_final_obs", None)
        assert json.loads(file.metadata["info"]) == plain(info)
        assert ("final_lanes" in file.metadata) is (final is not None)
        if final is not None:
            rows = np.flatnonzero(which)
            assert json.loads(file.metadata["final_lanes"]) == rows.tolist()
            batch = stack(space, [final[row] for row in rows])
            check_tensors(space, "final_obs", file, batch)
        if mode == "Disabled" and (terminated | truncated).any():
            reset_those_that_ended(client, url, env, (terminated | truncated).tolist())


def action_file(env, batch, **metadata):
    parts = spaces.encode_batch_tensors(env.single_action_space, "action", batch)
    if parts.texts:
        metadata["texts"] = parts.texts
    metadata = {name: json.dumps(value) for name, value in metadata.items()}
    return tensors.write(parts.tensors, metadata)


def test_cartpoles_own_lanes_are_those_of_gymnasium(client, create):
    url = create(num_envs=16)
    env = gymnasium.make_vec("CartPole-v1", num_envs=16)
    expected, _ = env.reset(seed=3)
    assert post(client, url, "reset", seed=3)["observation"] == expected.tolist()
    ended = 0
    for step in range(60):
        actions = np.random.default_rng(step).integers(0, 2, 16, dtype=np.int32)
        observation, reward, terminated, truncated, info = env.step(actions)
        file = read_tensors(
            client.post(
                f"{url}/step/",
                data=tensors.write({"action": Tensor.of(actions)}, {}),
                headers={"Content-Type": TENSORS, **ACCEPT},
            )
        )
        check_tensors(env.single_observation_space, "observation", file, observation)
        assert file.tensors["reward"].dtype == "F32"
        assert file.tensors["reward"].array().tolist() == reward.tolist()
        assert file.tensors["terminated"].array().tolist() == terminated.tolist()
        assert file.tensors["truncated"].array().tolist() == truncated.tolist()
        assert (json.loads(file.metadata["info"]), info) == ({}, {})
        ended += terminated.sum()
    assert ended > 0


def test_one_lane_has_a_dimension_of_its_own(client, create):
    url = create(num_envs=1)
    answer = post(client, url, "reset", seed=1)
    assert np.shape(answer["observation"]) == (1, 4)
    answer = post(client, url, "step", action=[1])
    assert (answer["reward"], answer["done"]) == ([1.0], [False])
    assert client.get(url).json["lanes"] == client.get(url).json["num_envs"] == 1


def test_final_infos_stay_where_gymnasium_puts_them(client, lanes):
    url = lanes(autoreset_mode="SameStep", longest=1)
    post(client, url, "reset", seed=1)
    answer = post(client, url, "step", action=[np.zeros((2, 3)).tolist()] * 3)
    assert answer["final_lanes"] == [0, 1, 2]
    assert answer["info"]["final_info"]["left"] == [0, 0, 0]
    assert answer["info"]["_final_info"] == [True] * 3
    assert "final_obs" not in answer["info"]


# Seeds ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [0, 5, [4, 0, 9]])
def test_the_seed_of_creation_serves_the_first_reset_that_has_none(client, lanes, seed):
    url, env = lanes(seed=seed, vectorization_mode="sync"), twin()
    first, second = (post(client, url, "reset")["observation"] for _ in range(2))
    assert first == members(env, env.reset(seed=seed)[0])
    assert second == members(env, env.reset()[0])
    assert client.get(url).json["seed"] == seed


@pytest.mark.parametrize("seed", [5, [None, 5, 6]])
def test_a_seed_seeds_the_action_space(client, lanes, seed):
    def samples(url):
        return [client.get(f"{url}/action_space/sample").json["action"] for _ in range(3)]

    one, other, third = (lanes(seed=seed) for _ in range(3))
    post(client, third, "reset", seed=8)
    expected = samples(one)
    assert samples(other) == expected
    assert samples(third) != expected
    post(client, third, "reset", seed=seed)
    assert samples(third) == expected


def test_a_seed_that_is_no_list_for_these_lanes_is_refused(client, lanes):
    url = lanes()
    code, message = refusal(client, url, "reset", seed=[1, 2])
    assert code == "invalid_parameter"
    assert message == (
        "The parameter 'seed' must hold one integer or null for each of the 3 lanes, not 2"
    )
    assert refusal(client, url, "reset", seed=[1, -2, 3])[0] == "invalid_parameter"
    assert refusal(client, url, "reset", seed=[1, "a", 3])[0] == "invalid_parameter"


# Masks ---------------------------------------------------------------------------------------


def row(info, index):
    """Return what a vector info says of one lane."""
    return {
        key: row(value, index) if isinstance(value, dict) else value[index]
        for key, value in info.items()
        if not key.startswith("_") and info[f"_{key}"][index]
    }


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", ["Box", "Dict", "Text", "Sequence"])
def test_lanes_that_step_alone_go_on_as_if_they_were_alone(client, lanes, kind, mode):
    url = lanes(kind, num_envs=4, autoreset_mode=mode, vectorization_mode="sync")
    alone = [twin(kind, num_envs=1, autoreset_mode=mode) for _ in range(4)]
    post(client, url, "reset", seed=20)
    for lane, env in enumerate(alone):
        env.reset(seed=20 + lane)
    space = alone[0].single_observation_space
    rng = np.random.default_rng(1)
    ended = np.zeros(4, dtype=bool)
    steps = 0
    for step in range(25):
        mask = rng.random(4) < 0.6
        mask &= ~ended
        if not mask.any():
            ended[:] = False
            post(client, url, "reset", seed=step)
            for lane, env in enumerate(alone):
                env.reset(seed=step + lane)
            continue
        stepping = np.flatnonzero(mask)
        expected, encoded = [], []
        for lane in stepping:
            actions, batch = actions_of(alone[lane], step)
            encoded += [spaces.encode(alone[lane].single_action_space, one) for one in actions]
            expected.append(alone[lane].step(batch))
        answer = post(client, url, "step", action=plain(encoded), step_mask=mask.tolist())
        steps += len(stepping)
        observations = [members(env, one[0])[0] for env, one in zip(alone, expected, strict=False)]
        assert apart(space, answer["observation"]) == observations
        for name, index in (("reward", 1), ("terminated", 2), ("truncated", 3)):
            assert answer[name] == [one[index].item() for one in expected]
        final_lanes = []
        for index, one in enumerate(expected):
            info = plain(one[4])
            final_lanes += [index] if info.pop("final_obs", None) is not None else []
            info.pop("_final_obs", None)
            assert row(answer["info"], index) == row(info, 0)
        assert answer.get("final_lanes", []) == final_lanes
        if mode == "Disabled":
            ended[stepping] = answer["done"]
    assert client.get(url).json["steps"] == steps


def test_a_reset_by_mask_shows_the_other_lanes_where_they_are(client, lanes):
    url = lanes("Discrete", vectorization_mode="sync")
    before = post(client, url, "reset", seed=2)["observation"]
    stepped = post(client, url, "step", action=[0], step_mask=[False, True, False])["observation"]
    assert stepped != before[1:2]
    after = post(client, url, "reset", seed=9, reset_mask=[True, False, False])["observation"]
    assert after[1:] == [*stepped, before[2]]


def test_a_seed_for_some_lanes_leaves_the_action_space_alone(client, lanes):
    one, other = (lanes(seed=3, vectorization_mode="sync") for _ in range(2))
    post(client, one, "reset")
    post(client, one, "reset", seed=5, reset_mask=[True, False, False])
    samples = [client.get(f"{url}/action_space/sample").json for url in (one, other)]
    assert samples[0] == samples[1]


def test_stepping_every_lane_by_mask_is_stepping(client, lanes):
    masked, plainly = lanes(vectorization_mode="sync"), lanes()
    for url in (masked, plainly):
        post(client, url, "reset", seed=2)
    for step in range(8):
        action = np.full((3, 2, 3), step).tolist()
        assert post(client, masked, "step", action=action, step_mask=[True] * 3) == post(
            client, plainly, "step", action=action
        )


def test_a_step_mask_travels_in_the_metadata_of_tensors(client, lanes):
    url, env = lanes("Discrete", vectorization_mode="sync"), twin("Discrete")
    post(client, url, "reset", seed=2)
    file = read_tensors(
        client.post(
            f"{url}/step/",
            data=action_file(env, np.array([0, 1]), step_mask=[True, False, True]),
            headers={"Content-Type": TENSORS, **ACCEPT},
        )
    )
    assert {name: tensor.shape for name, tensor in file.tensors.items()} == dict.fromkeys(
        ("observation", "reward", "terminated", "truncated"), (2,)
    )


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_a_reset_by_mask_leaves_the_other_lanes_alone(client, lanes, mode):
    url, env = lanes(vectorization_mode=mode), twin()
    post(client, url, "reset", seed=2)
    env.reset(seed=2)
    for seed in (None, 4, [None, 6, 8]):
        mask = [False, True, True]
        answer = post(client, url, "reset", seed=seed, reset_mask=mask)
        expected, info = env.reset(seed=seed, options={"reset_mask": np.array(mask)})
        assert answer["observation"] == expected.tolist()
        assert answer["info"] == plain(info)


@pytest.mark.parametrize(
    ("mask", "wanted"),
    [
        ([True, False], "must hold one boolean for each of the 3 lanes, not 2"),
        ([False] * 3, "must hold true for at least one lane"),
        ([], "must be a list of true or false for each lane, not []"),
        ([1, 0, 1], "must be a list of true or false for each lane"),
        ([[True]] * 3, "must be a list of true or false for each lane"),
        ("true", "must be a list of true or false for each lane"),
    ],
)
@pytest.mark.parametrize("route", ["reset", "step"])
def test_what_is_no_mask_for_these_lanes_is_refused(client, lanes, route, mask, wanted):
    url = lanes("Discrete")
    post(client, url, "reset", seed=1)
    code, message = refusal(client, url, route, action=[0] * 3, **{f"{route}_mask": mask})
    assert code == "invalid_parameter"
    assert wanted in message
    check_that_no_lane_moved(client, url, "Discrete", seed=1)


def check_that_no_lane_moved(client, url, kind, seed, mode="NextStep"):
    """Hold the next step equal to the first one after a reset."""
    env = twin(kind, autoreset_mode=mode)
    env.reset(seed=seed)
    actions, batch = actions_of(env, 0)
    encoded = [plain(spaces.encode(env.single_action_space, action)) for action in actions]
    check_step(env, post(client, url, "step", action=encoded), env.step(batch))


def test_what_an_implementation_has_not_is_refused(client, create, lanes):
    own, processes = create(num_envs=3), lanes("Discrete", vectorization_mode="async")
    for url in (own, processes):
        post(client, url, "reset", seed=1)
    refused = client.post(f"{own}/reset/", json={"reset_mask": [True] * 3}).json
    assert refused["code"] == "not_supported"
    assert refused["hint"] == "create the environment with vectorization_mode 'sync'"
    assert refusal(client, own, "reset", seed=[1, 2, 3])[0] == "not_supported"
    for url in (own, processes):
        code, _ = refusal(client, url, "step", action=[0] * 3, step_mask=[True] * 3)
        assert code == "not_supported"
    check_that_no_lane_moved(client, processes, "Discrete", seed=1)


def test_a_mask_in_the_options_is_refused(client, lanes):
    refused = refusal(client, lanes(), "reset", options={"reset_mask": [True] * 3})
    assert refused[0] == "invalid_parameter"


def test_a_mask_needs_lanes_that_were_reset(client, lanes):
    assert refusal(client, lanes(), "reset", reset_mask=[True] * 3)[0] == "reset_needed"


@pytest.mark.parametrize("name", ["reset_mask", "step_mask"])
def test_a_mask_for_a_single_environment_is_refused(client, create, name):
    url = create()
    client.post(f"{url}/reset/")
    route = name.partition("_")[0]
    refused = client.post(f"{url}/{route}/", json={"action": 0, name: [True]}).json
    assert (refused["code"], refused["hint"]) == ("not_supported", "create it with num_envs")


def test_a_list_of_seeds_for_a_single_environment_is_refused(client, create):
    code, message = refusal(client, create(), "reset", seed=[5])
    assert code == "invalid_parameter"
    assert message == "The parameter 'seed' must be an integer, 0 or greater, not [5]"


# Actions that are none -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "action", "words"),
    [
        ("Discrete", [0, 0], "for each of the 3 lanes is needed, not 2"),
        ("Discrete", 0, "for each of the 3 lanes is needed, as a list"),
        ("Discrete", [0, 7, 0], "7 at [1] is not in Discrete(5, start=-2)"),
        ("Discrete", [0, True, 0], "true at [1] is not in Discrete"),
        ("Discrete", [0, 0, 0.5], "0.5 at [2] is not in Discrete"),
        ("bytes", [[0] * 4, [0] * 4, [0, 0, 300, 0]], "300 at [2][2] is not in Box"),
        ("bytes", [[0] * 4, [0] * 3, [0] * 4], "[0, 0, 0] at [1] is not in Box"),
        ("MultiBinary", [[0] * 4, [0] * 4, [0, 2, 0, 0]], "2 at [2]"),
        ("Text", ["a", "b", "z"], '"z" at [2] is not in Text'),
        ("Sequence", [[], [], [[0, 2]]], "2.0 at [2][0][1] is not in"),
    ],
)
def test_an_action_that_is_none_is_named_with_its_lane(client, lanes, kind, action, words):
    url = lanes(kind)
    post(client, url, "reset", seed=1)
    code, message = refusal(client, url, "step", action=action)
    assert code == "action_not_in_space"
    assert message.startswith("The action ")
    assert words in message
    check_that_no_lane_moved(client, url, kind, seed=1)


@pytest.mark.parametrize(
    ("kind", "tensor", "words"),
    [
        ("Discrete", np.array([0, 0], np.int64), "for each of the 3 lanes is needed, not 2"),
        ("Discrete", np.array([0, 0, 7], np.int32), "7 at [2] is not in Discrete"),
        ("Discrete", np.array([0, 0, -3], np.int64), "-3 at [2] is not in Discrete"),
        ("Discrete", np.array([0, 0, 0], np.int16), "I64 [3] is needed"),
        ("Discrete", np.array(0), "I64 [3] is needed"),
        ("Discrete", np.zeros((3, 1), np.int64), "I64 [3] is needed"),
        ("Box", np.full((3, 2, 3), np.nan, np.float32), '"NaN" at [0][0][0]'),
        ("Box", np.zeros((3, 2, 3)), "F32 [3, 2, 3] is needed"),
        ("bytes", np.full((3, 4), 255, np.uint8), "255 at [0][0]"),
    ],
)
def test_tensors_that_are_no_actions_are_named_with_their_lane(client, lanes, kind, tensor, words):
    url = lanes(kind)
    post(client, url, "reset", seed=1)
    answer = client.post(
        f"{url}/step/",
        data=tensors.write({"action": Tensor.of(tensor)}, {}),
        headers={"Content-Type": TENSORS},
    )
    assert (answer.status_code, answer.json["code"]) == (400, "action_not_in_space")
    assert words in answer.json["message"]
    check_that_no_lane_moved(client, url, kind, seed=1)


def test_the_lane_comes_first_in_the_path_to_what_is_wrong(client, lanes):
    url, env = lanes("Dict"), twin("Dict")
    post(client, url, "reset", seed=1)
    actions, _ = actions_of(env, 0)
    wrong = [dict(action) for action in actions]
    wrong[2]["a/b~"] = (wrong[2]["a/b~"][0], np.array([7.0]))
    encoded = [plain(spaces.encode(env.single_action_space, action)) for action in wrong]
    in_json = refusal(client, url, "step", action=encoded)[1]
    answer = client.post(
        f"{url}/step/",
        data=action_file(env, stack(env.single_action_space, wrong)),
        headers={"Content-Type": TENSORS},
    )
    assert "7.0 at [2]$`a/b~`[1][0] is not in" in in_json
    assert answer.json["message"] == in_json
    check_that_no_lane_moved(client, url, "Dict", seed=1)


def test_an_action_space_that_holds_nothing_is_refused(client):
    body = {"env_id": "faulty_envs:Uneven-v0", "num_envs": 2, "kwargs": {"space": "nothing"}}
    answer = client.post("/v1/envs/", json=body)
    assert (answer.status_code, answer.json["code"]) == (400, "unsupported_space")
    assert "empty Tuple or Dict" in answer.json["hint"]


# Episodes that are over ----------------------------------------------------------------------


def test_a_lane_that_ended_does_not_step_when_nobody_resets_it(client, lanes):
    url = lanes("Discrete", num_envs=12, autoreset_mode="Disabled", longest=2)
    post(client, url, "reset", seed=10)
    assert client.get(url).json["needs_reset"] is False
    answer = post(client, url, "step", action=[0] * 12)
    assert any(answer["terminated"])
    assert any(answer["truncated"])
    ended = np.flatnonzero(answer["done"])
    assert 1 < len(ended) < 12
    assert client.get(url).json["needs_reset"] is True
    code, message = refusal(client, url, "step", action=[0] * 12)
    assert code == "reset_needed"
    assert f"lanes {', '.join(map(str, ended))} ended" in message
    some = np.zeros(12, dtype=bool)
    some[ended[:1]] = True
    code, message = refusal(client, url, "step", action=[0], step_mask=some.tolist())
    assert (code, f"lane {ended[0]} ended" in message) == ("reset_needed", True)
    assert client.get(url).json["steps"] == 12
    others = ~np.array(answer["done"])
    post(client, url, "step", action=[0] * int(others.sum()), step_mask=others.tolist())
    post(client, url, "reset", reset_mask=[True] * 12)
    post(client, url, "step", action=[0] * 12)


@pytest.mark.parametrize("route", ["step/", "render/"])
def test_before_the_first_reset_there_is_nothing_to_do(client, lanes, route):
    call = client.get if route == "render/" else client.post
    answer = call(f"{lanes()}/{route}", json={"action": 0})
    assert (answer.status_code, answer.json["code"]) == (400, "reset_needed")


def test_after_a_step_that_failed_half_way_the_lanes_need_a_reset(client, lanes):
    url = lanes("Discrete", num_envs=12, name="SpoilsOneLane")
    post(client, url, "reset", seed=1)
    answer = client.post(f"{url}/step/", json={"action": [0] * 12})
    assert (answer.status_code, answer.json["code"]) == (500, "environment_error")
    assert refusal(client, url, "step", action=[0] * 12)[0] == "reset_needed"
    assert client.get(url).json["needs_reset"] is True
    post(client, url, "reset", seed=1)


# The rest ------------------------------------------------------------------------------------


def test_all_about_lanes(client, create):
    url = create(num_envs=3, seed=[1, None, 0], autoreset_mode="same_step")
    about = client.get(url).json
    wanted = {
        "lanes": 3,
        "num_envs": 3,
        "vectorization_mode": "sync",
        "autoreset_mode": "SameStep",
        "seed": [1, None, 0],
        "max_episode_steps": 500,
        "reward_threshold": 475.0,
        "render_mode": "rgb_array",
        "steps": 0,
        "needs_reset": True,
        "action_space": {"name": "Discrete", "n": 2, "start": 0, "dtype": "int64"},
    }
    assert {name: about[name] for name in wanted} == wanted
    assert about["observation_space"]["shape"] == [4]


@pytest.mark.parametrize("mode", [None, "sync", "async"])
def test_the_time_limit_is_the_one_that_was_chosen(client, create, mode):
    url = create(num_envs=2, vectorization_mode=mode, kwargs={"max_episode_steps": 7})
    assert client.get(url).json["max_episode_steps"] == 7


def test_the_spaces_are_those_of_all_lanes(client, create):
    url = create(num_envs=3)
    space = client.get(f"{url}/observation_space/").json["info"]
    assert (space["name"], space["shape"], len(space["low"])) == ("Box", [3, 4], 12)
    space = client.get(f"{url}/action_space/").json["info"]
    assert (space["name"], space["nvec"]) == ("MultiDiscrete", [2, 2, 2])
    assert client.post(f"{url}/action_space/contains", json=space).json == {"member": True}


@pytest.mark.parametrize("kind", KINDS)
def test_a_sample_is_a_list_of_actions_and_contained(client, lanes, kind):
    url = lanes(kind, seed=3)
    sample = client.get(f"{url}/action_space/sample").json["action"]
    env = twin(kind)
    env.action_space.seed(3)
    batch = env.action_space.sample()
    space = env.single_action_space
    assert sample == [plain(spaces.encode(space, one)) for one in unstack(space, batch)]
    for which in ("action_space", "observation_space"):
        contains = f"{url}/{which}/contains"
        assert client.post(contains, json={"value": sample}).json == {"member": True}
        assert client.post(contains, json={"value": sample[:2]}).json == {"member": False}
        assert client.post(contains, json={"value": "x"}).json == {"member": False}


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_a_frame_shows_one_lane(client, lanes, mode):
    url, env = lanes(vectorization_mode=mode), twin()
    post(client, url, "reset", seed=4)
    env.reset(seed=4)
    for lane in range(3):
        answer = client.get(f"{url}/render/?lane={lane}", headers=ACCEPT)
        frame = read_tensors(answer).tensors["frame"].array()
        assert frame[0, 0, 0] == env.envs[lane].unwrapped.left
    assert client.get(f"{url}/render/").data == client.get(f"{url}/render/?lane=0").data


def test_an_implementation_that_draws_all_lanes_at_once_draws_few(client, create):
    few, many = create(num_envs=16), create(num_envs=17)
    for url in (few, many):
        post(client, url, "reset", seed=1)
    frames = [client.get(f"{few}/render/?lane={lane}") for lane in (0, 15)]
    assert [frame.status_code for frame in frames] == [200, 200]
    assert frames[0].data != frames[1].data
    refused = client.get(f"{many}/render/").json
    assert refused["code"] == "cannot_render"
    assert "'sync'" in refused["hint"]


@pytest.mark.parametrize("lane", ["3", "-1", "a", "1.0"])
def test_a_lane_that_there_is_not_is_refused(client, lanes, create, lane):
    for url in (lanes(), create()):
        client.post(f"{url}/reset/")
        answer = client.get(f"{url}/render/?lane={lane}")
        assert (answer.status_code, answer.json["code"]) == (400, "invalid_parameter")
        assert client.get(f"{url}/render/?lane=0").status_code == 200


def test_lanes_are_not_monitored(client, lanes):
    code, message = refusal(client, lanes(), "monitor/start", directory="d")
    assert (code, "has lanes" in message) == ("not_supported", True)


def test_lanes_that_draw_in_each_step_draw_on_the_render_thread(client, create):
    url = create("faulty_envs:Drawing-v0", num_envs=2, wrappers=[{"name": "AddRenderObservation"}])
    faulty_envs.Drawing.threads.clear()
    post(client, url, "reset", seed=1)
    post(client, url, "step", action=[0, 0])
    post(client, url, "step", action=[0], step_mask=[False, True])
    client.post(f"{url}/close/")
    assert len(faulty_envs.Drawing.threads) == 1


def test_wrappers_are_put_around_each_lane(client, create):
    wrappers = [{"name": "TimeLimit", "kwargs": {"max_episode_steps": 2}}]
    url = create("faulty_envs:Counting-v0", num_envs=2, wrappers=wrappers)
    post(client, url, "reset")
    answers = [post(client, url, "step", action=[0, 0]) for _ in range(2)]
    assert [answer["truncated"] for answer in answers] == [[False] * 2, [True] * 2]
