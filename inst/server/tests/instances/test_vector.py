import json

import faulty_envs
import gymnasium
import numpy as np
import pytest
from vector_play import (
    ACCEPT,
    IN_TENSORS,
    KINDS,
    MODES,
    MODES_SLOWLY,
    action_file,
    actions_of,
    apart,
    check_step,
    check_tensors,
    members,
    post,
    read_tensors,
    refusal,
    reset_those_that_ended,
    twin,
)

from gym_server import spaces
from gym_server.json_values import plain
from gym_server.protocol import safetensors
from gym_server.protocol.safetensors import TENSORS, Tensor
from gym_server.spaces.stacking import stack, unstack

# The same as in Gymnasium --------------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES_SLOWLY)
@pytest.mark.parametrize("kind", KINDS)
def test_sub_envs_in_json_are_those_of_gymnasium(client, sub_envs, kind, mode):
    check_play(client, sub_envs(kind, autoreset_mode=mode, vectorization_mode="sync"), kind, mode)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", ["Box", "Dict", "Sequence"])
def test_sub_envs_in_processes_are_those_of_gymnasium(client, sub_envs, kind, mode):
    check_play(client, sub_envs(kind, autoreset_mode=mode, vectorization_mode="async"), kind, mode)


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
            # Even if an automatic reset is due.
            expected, _ = env.reset(seed=[3, None, 5])
            answer = post(client, url, "reset", seed=[3, None, 5])
            assert apart(space, answer["observation"]) == members(env, expected)
    assert client.get(url).json["steps"] == steps * 3


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", IN_TENSORS)
def test_sub_envs_in_tensors_are_those_of_gymnasium_byte_for_byte(client, sub_envs, kind, mode):
    url, env = sub_envs(kind, autoreset_mode=mode), twin(kind, autoreset_mode=mode)
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
        assert ("final_sub_envs" in file.metadata) is (final is not None)
        if final is not None:
            rows = np.flatnonzero(which)
            assert json.loads(file.metadata["final_sub_envs"]) == rows.tolist()
            batch = stack(space, [final[row] for row in rows])
            check_tensors(space, "final_obs", file, batch)
        if mode == "Disabled" and (terminated | truncated).any():
            reset_those_that_ended(client, url, env, (terminated | truncated).tolist())


def test_cartpoles_own_sub_envs_are_those_of_gymnasium(client, create):
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
                data=safetensors.write({"action": Tensor.of(actions)}, {}),
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


def test_one_sub_env_has_a_dimension_of_its_own(client, create):
    url = create(num_envs=1)
    answer = post(client, url, "reset", seed=1)
    assert np.shape(answer["observation"]) == (1, 4)
    answer = post(client, url, "step", action=[1])
    assert (answer["reward"], answer["done"]) == ([1.0], [False])
    assert client.get(url).json["num_envs"] == 1


def test_final_infos_stay_where_gymnasium_puts_them(client, sub_envs):
    url = sub_envs(autoreset_mode="SameStep", longest=1)
    post(client, url, "reset", seed=1)
    answer = post(client, url, "step", action=[np.zeros((2, 3)).tolist()] * 3)
    assert answer["final_sub_envs"] == [0, 1, 2]
    assert answer["info"]["final_info"]["left"] == [0, 0, 0]
    assert answer["info"]["_final_info"] == [True] * 3
    assert "final_obs" not in answer["info"]


# Seeds ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [0, 5, [4, 0, 9]])
def test_the_seed_of_creation_serves_the_first_reset_that_has_none(client, sub_envs, seed):
    url, env = sub_envs(seed=seed, vectorization_mode="sync"), twin()
    first, second = (post(client, url, "reset")["observation"] for _ in range(2))
    assert first == members(env, env.reset(seed=seed)[0])
    assert second == members(env, env.reset()[0])
    assert client.get(url).json["seed"] == seed


@pytest.mark.parametrize("seed", [5, [None, 5, 6]])
def test_a_seed_seeds_the_action_space(client, sub_envs, seed):
    def samples(url):
        return [client.get(f"{url}/action_space/sample").json["action"] for _ in range(3)]

    one, other, third = (sub_envs(seed=seed) for _ in range(3))
    post(client, third, "reset", seed=8)
    expected = samples(one)
    assert samples(other) == expected
    assert samples(third) != expected
    post(client, third, "reset", seed=seed)
    assert samples(third) == expected


def test_a_seed_that_is_no_list_for_these_sub_envs_is_refused(client, sub_envs):
    url = sub_envs()
    code, message = refusal(client, url, "reset", seed=[1, 2])
    assert code == "invalid_parameter"
    assert message == (
        "The parameter 'seed' must hold one integer or null for each of the 3 sub-environments, "
        "not 2"
    )
    assert refusal(client, url, "reset", seed=[1, -2, 3])[0] == "invalid_parameter"
    assert refusal(client, url, "reset", seed=[1, "a", 3])[0] == "invalid_parameter"


# Episodes that have ended --------------------------------------------------------------------


def test_a_sub_env_that_ended_does_not_step_when_nobody_resets_it(client, sub_envs):
    url = sub_envs("Discrete", num_envs=12, autoreset_mode="Disabled", longest=2)
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
    assert f"sub-environments {', '.join(map(str, ended))} ended" in message
    some = np.zeros(12, dtype=bool)
    some[ended[:1]] = True
    code, message = refusal(client, url, "step", action=[0], step_mask=some.tolist())
    assert (code, f"sub-environment {ended[0]} ended" in message) == ("reset_needed", True)
    assert client.get(url).json["steps"] == 12
    others = ~np.array(answer["done"])
    post(client, url, "step", action=[0] * int(others.sum()), step_mask=others.tolist())
    post(client, url, "reset", reset_mask=[True] * 12)
    post(client, url, "step", action=[0] * 12)


@pytest.mark.parametrize("route", ["step/", "render/"])
def test_before_the_first_reset_there_is_nothing_to_do(client, sub_envs, route):
    call = client.get if route == "render/" else client.post
    answer = call(f"{sub_envs()}/{route}", json={"action": 0})
    assert (answer.status_code, answer.json["code"]) == (400, "reset_needed")


def test_after_a_step_that_failed_half_way_the_sub_envs_need_a_reset(client, sub_envs):
    url = sub_envs("Discrete", num_envs=12, name="SpoilsOneSubEnv")
    post(client, url, "reset", seed=1)
    answer = client.post(f"{url}/step/", json={"action": [0] * 12})
    assert (answer.status_code, answer.json["code"]) == (500, "environment_error")
    assert refusal(client, url, "step", action=[0] * 12)[0] == "reset_needed"
    assert client.get(url).json["needs_reset"] is True
    post(client, url, "reset", seed=1)


# The rest ------------------------------------------------------------------------------------


def test_all_about_sub_envs(client, create):
    url = create(num_envs=3, seed=[1, None, 0], autoreset_mode="same_step")
    about = client.get(url).json
    wanted = {
        "num_envs": 3,
        "vectorization_mode": "sync",
        "autoreset_mode": "SameStep",
        "seed": [1, None, 0],
        "max_episode_steps": 500,
        "reward_threshold": 475.0,
        "render_fps": 50,
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


def test_the_spaces_are_those_of_all_sub_envs(client, create):
    url = create(num_envs=3)
    space = client.get(f"{url}/observation_space/").json["info"]
    assert (space["name"], space["shape"], len(space["low"])) == ("Box", [3, 4], 12)
    space = client.get(f"{url}/action_space/").json["info"]
    assert (space["name"], space["nvec"]) == ("MultiDiscrete", [2, 2, 2])
    assert client.post(f"{url}/action_space/contains", json=space).json == {"member": True}


@pytest.mark.parametrize("kind", KINDS)
def test_a_sample_is_a_list_of_actions_and_contained(client, sub_envs, kind):
    url = sub_envs(kind, seed=3)
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
def test_a_frame_shows_one_sub_env(client, sub_envs, mode):
    url, env = sub_envs(vectorization_mode=mode), twin()
    post(client, url, "reset", seed=4)
    env.reset(seed=4)
    for sub_env in range(3):
        answer = client.get(f"{url}/render/?sub_env={sub_env}", headers=ACCEPT)
        frame = read_tensors(answer).tensors["frame"].array()
        assert frame[0, 0, 0] == env.envs[sub_env].unwrapped.left
    assert client.get(f"{url}/render/").data == client.get(f"{url}/render/?sub_env=0").data


def test_an_implementation_that_draws_all_sub_envs_at_once_draws_few(client, create):
    few, many = create(num_envs=16), create(num_envs=17)
    for url in (few, many):
        post(client, url, "reset", seed=1)
    frames = [client.get(f"{few}/render/?sub_env={sub_env}") for sub_env in (0, 15)]
    assert [frame.status_code for frame in frames] == [200, 200]
    assert frames[0].data != frames[1].data
    refused = client.get(f"{many}/render/").json
    assert refused["code"] == "cannot_render"
    assert "'sync'" in refused["hint"]


@pytest.mark.parametrize("sub_env", ["3", "-1", "a", "1.0"])
def test_a_sub_env_that_there_is_not_is_refused(client, sub_envs, create, sub_env):
    for url in (sub_envs(), create()):
        client.post(f"{url}/reset/")
        answer = client.get(f"{url}/render/?sub_env={sub_env}")
        assert (answer.status_code, answer.json["code"]) == (400, "invalid_parameter")
        assert client.get(f"{url}/render/?sub_env=0").status_code == 200


def test_sub_envs_are_not_monitored(client, sub_envs):
    code, message = refusal(client, sub_envs(), "monitor/start", directory="d")
    assert (code, "has sub-environments" in message) == ("not_supported", True)


def test_sub_envs_that_draw_in_each_step_draw_on_the_render_thread(client, create):
    url = create("faulty_envs:Drawing-v0", num_envs=2, wrappers=[{"name": "AddRenderObservation"}])
    faulty_envs.Drawing.threads.clear()
    post(client, url, "reset", seed=1)
    post(client, url, "step", action=[0, 0])
    post(client, url, "step", action=[0], step_mask=[False, True])
    client.post(f"{url}/close/")
    assert len(faulty_envs.Drawing.threads) == 1


def test_wrappers_are_put_around_each_sub_env(client, create):
    wrappers = [{"name": "TimeLimit", "kwargs": {"max_episode_steps": 2}}]
    url = create("faulty_envs:Counting-v0", num_envs=2, wrappers=wrappers)
    post(client, url, "reset")
    answers = [post(client, url, "step", action=[0, 0]) for _ in range(2)]
    assert [answer["truncated"] for answer in answers] == [[False] * 2, [True] * 2]


@pytest.mark.parametrize("num_workers", [0, 2])
def test_a_lander_is_drawn_when_somebody_asks(client, create, num_workers):
    pytest.importorskip("Box2D")
    url = create("LunarLander-v3", num_envs=2, num_workers=num_workers)
    post(client, url, "reset", seed=1)
    assert client.get(url).json["render_mode"] == "rgb_array"
    assert client.get(f"{url}/render?sub_env=1").content_type == "image/png"
    post(client, url, "step", action=[2, 2])
