import numpy as np
import pytest
from vector_play import (
    ACCEPT,
    MODES_SLOWLY,
    action_file,
    actions_of,
    apart,
    check_that_no_sub_env_moved,
    members,
    post,
    read_tensors,
    refusal,
    twin,
)

from gym_server import spaces
from gym_server.json_values import plain
from gym_server.protocol.safetensors import TENSORS

pytestmark = pytest.mark.slow


def row(info, index):
    """Return the part of a vector info for one sub-environment."""
    return {
        key: row(value, index) if isinstance(value, dict) else value[index]
        for key, value in info.items()
        if not key.startswith("_") and info[f"_{key}"][index]
    }


@pytest.mark.parametrize("num_workers", [0, 3])
@pytest.mark.parametrize("mode", MODES_SLOWLY)
@pytest.mark.parametrize("kind", ["Box", "Dict", "Text", "Sequence"])
def test_sub_envs_that_step_alone_go_on_as_if_they_were_alone(
    client, sub_envs, kind, mode, num_workers
):
    url = sub_envs(kind, num_envs=4, autoreset_mode=mode, num_workers=num_workers)
    alone = [twin(kind, num_envs=1, autoreset_mode=mode) for _ in range(4)]
    post(client, url, "reset", seed=20)
    for sub_env, env in enumerate(alone):
        env.reset(seed=20 + sub_env)
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
            for sub_env, env in enumerate(alone):
                env.reset(seed=step + sub_env)
            continue
        stepping = np.flatnonzero(mask)
        expected, encoded = [], []
        for sub_env in stepping:
            actions, batch = actions_of(alone[sub_env], step)
            encoded += [spaces.encode(alone[sub_env].single_action_space, one) for one in actions]
            expected.append(alone[sub_env].step(batch))
        answer = post(client, url, "step", action=plain(encoded), step_mask=mask.tolist())
        steps += len(stepping)
        observations = [members(env, one[0])[0] for env, one in zip(alone, expected, strict=False)]
        assert apart(space, answer["observation"]) == observations
        for name, index in (("reward", 1), ("terminated", 2), ("truncated", 3)):
            assert answer[name] == [one[index].item() for one in expected]
        final_sub_envs = []
        for index, one in enumerate(expected):
            info = plain(one[4])
            final_sub_envs += [index] if info.pop("final_obs", None) is not None else []
            info.pop("_final_obs", None)
            assert row(answer["info"], index) == row(info, 0)
        assert answer.get("final_sub_envs", []) == final_sub_envs
        if mode == "Disabled":
            ended[stepping] = answer["done"]
    assert client.get(url).json["steps"] == steps


def test_a_reset_by_mask_shows_the_other_sub_envs_where_they_are(client, sub_envs):
    url = sub_envs("Discrete", vectorization_mode="sync")
    before = post(client, url, "reset", seed=2)["observation"]
    stepped = post(client, url, "step", action=[0], step_mask=[False, True, False])["observation"]
    assert stepped != before[1:2]
    after = post(client, url, "reset", seed=9, reset_mask=[True, False, False])["observation"]
    assert after[1:] == [*stepped, before[2]]


def test_a_seed_for_some_sub_envs_leaves_the_action_space_alone(client, sub_envs):
    one, other = (sub_envs(seed=3, vectorization_mode="sync") for _ in range(2))
    post(client, one, "reset")
    post(client, one, "reset", seed=5, reset_mask=[True, False, False])
    samples = [client.get(f"{url}/action_space/sample").json for url in (one, other)]
    assert samples[0] == samples[1]


def test_stepping_every_sub_env_by_mask_is_stepping(client, sub_envs):
    masked, plainly = sub_envs(vectorization_mode="sync"), sub_envs()
    for url in (masked, plainly):
        post(client, url, "reset", seed=2)
    for step in range(8):
        action = np.full((3, 2, 3), step).tolist()
        assert post(client, masked, "step", action=action, step_mask=[True] * 3) == post(
            client, plainly, "step", action=action
        )


def test_a_step_mask_travels_in_the_metadata_of_tensors(client, sub_envs):
    url, env = sub_envs("Discrete", vectorization_mode="sync"), twin("Discrete")
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
def test_a_reset_by_mask_leaves_the_other_sub_envs_alone(client, sub_envs, mode):
    url, env = sub_envs(vectorization_mode=mode), twin()
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
        ([True, False], "must hold one boolean for each of the 3 sub-environments, not 2"),
        ([False] * 3, "must hold true for at least one sub-environment"),
        ([], "must be a list of true or false for each sub-environment, not []"),
        ([1, 0, 1], "must be a list of true or false for each sub-environment"),
        ([[True]] * 3, "must be a list of true or false for each sub-environment"),
        ("true", "must be a list of true or false for each sub-environment"),
    ],
)
@pytest.mark.parametrize("route", ["reset", "step"])
def test_what_is_no_mask_for_these_sub_envs_is_refused(client, sub_envs, route, mask, wanted):
    url = sub_envs("Discrete")
    post(client, url, "reset", seed=1)
    code, message = refusal(client, url, route, action=[0] * 3, **{f"{route}_mask": mask})
    assert code == "invalid_parameter"
    assert wanted in message
    check_that_no_sub_env_moved(client, url, "Discrete", seed=1)


def test_what_an_implementation_has_not_is_refused(client, create):
    own = create(num_envs=3)
    before = post(client, own, "reset", seed=1)
    refused = client.post(f"{own}/reset/", json={"reset_mask": [True] * 3}).json
    assert refused["code"] == "not_supported"
    assert refused["hint"] == "create the environment with vectorization_mode 'sync'"
    assert refusal(client, own, "reset", seed=[1, 2, 3])[0] == "not_supported"
    assert refusal(client, own, "reset", seed=[[1, 2], 2, 3])[0] == "not_supported"
    code, _ = refusal(client, own, "step", action=[0] * 3, step_mask=[True] * 3)
    assert code == "not_supported"
    again = create(num_envs=3)
    assert post(client, again, "reset", seed=1) == before
    assert post(client, own, "step", action=[0] * 3) == post(client, again, "step", action=[0] * 3)


def test_a_mask_in_the_options_is_refused(client, sub_envs):
    refused = refusal(client, sub_envs(), "reset", options={"reset_mask": [True] * 3})
    assert refused[0] == "invalid_parameter"


def test_a_mask_needs_sub_envs_that_were_reset(client, sub_envs):
    assert refusal(client, sub_envs(), "reset", reset_mask=[True] * 3)[0] == "reset_needed"


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


@pytest.mark.parametrize("num_workers", [0, 2])
def test_sub_envs_rest_when_their_seeds_are_used_up(client, sub_envs, num_workers):
    url = sub_envs(autoreset_mode="SameStep", num_workers=num_workers)
    post(client, url, "reset", seed=[[1, 2], [3], [4]])
    action = np.zeros((3, 2, 3)).tolist()
    steps, ended = 0, np.zeros(3, dtype=int)
    while ended.tolist() != [2, 1, 1]:
        steps += int((ended < [2, 1, 1]).sum())
        answer = post(client, url, "step", action=action, final_obs=False)
        assert "final_obs" not in answer
        ended += answer["done"]
    after = post(client, url, "step", action=action)
    assert (after["observation"], after["reward"]) == (answer["observation"], [0.0] * 3)
    assert after["done"] == [False] * 3
    about = client.get(url).json
    assert (about["steps"], about["needs_reset"]) == (steps, True)
    post(client, url, "reset", seed=9, reset_mask=[False, True, False])
    assert post(client, url, "step", action=action)["reward"][1] != 0


def test_seeds_for_later_need_episodes_that_begin_by_themselves(client, sub_envs):
    code, message = refusal(
        client, sub_envs(autoreset_mode="Disabled"), "reset", seed=[[1, 2], 3, 4]
    )
    assert code == "invalid_parameter"
    assert "autoreset_mode 'Disabled'" in message
    url = sub_envs(autoreset_mode="SameStep")
    for seed in ([[], 1, 2], [[-1], 1, 2], [["1"], 1, 2]):
        code, message = refusal(client, url, "reset", seed=seed)
        assert code == "invalid_parameter"
        assert "'seed' must be an integer, 0 or greater, or a list of one, null, or" in message
