"""Atari's own vector implementation."""

import pytest


@pytest.fixture
def atari(client):
    """Make Pong by Atari's own implementation, with short episodes; return its URL."""
    pytest.importorskip("ale_py")

    def atari(num_envs=2, **fields):
        answer = client.post(
            "/v1/envs/",
            json={
                "env_id": "ALE/Pong-v5",
                "num_envs": num_envs,
                "vectorization_mode": "vector_entry_point",
                "kwargs": {"max_num_frames_per_episode": 60, "noop_max": 30, "stack_num": 1},
                **fields,
            },
        )
        assert answer.status_code == 200, answer.json
        return f"/v1/envs/{answer.json['instance_id']}"

    return atari


def frames(client, url, **fields):
    answer = client.post(f"{url}/reset/", json=fields)
    assert answer.status_code == 200, answer.json
    return answer.json["info"]["episode_frame_number"]


@pytest.mark.slow
def test_atari_takes_a_seed_for_each_sub_environment(client, atari):
    url = atari(seed=[5, 5])
    first, second = frames(client, url)
    assert first == second
    first, second = frames(client, url, seed=[5, None])
    assert first != frames(client, url, seed=6)[0]


@pytest.mark.slow
def test_atari_resets_those_of_a_mask(client, atari):
    url = atari()
    frames(client, url, seed=1)
    client.post(f"{url}/step/", json={"action": [0, 0]})
    before = client.post(f"{url}/step/", json={"action": [0, 0]}).json["info"]
    after = frames(client, url, seed=[None, 3], reset_mask=[False, True])
    assert after[0] == before["episode_frame_number"][0]
    assert after[1] < before["episode_frame_number"][1]


@pytest.mark.slow
def test_atari_resets_in_the_same_step(client, atari):
    url = atari(autoreset_mode="SameStep")
    frames(client, url, seed=[1, 1])
    answer = {"done": [False]}
    while not any(answer["done"]):
        answer = client.post(f"{url}/step/", json={"action": [0, 0]}).json
    assert answer["truncated"] == [True, True]
    assert answer["final_sub_envs"] == [0, 1]
    assert answer["info"]["episode_frame_number"][0] < 60


def test_a_seed_that_is_too_large_for_atari_is_refused_before_the_reset(client, atari):
    answer = client.post(f"{atari()}/reset/", json={"seed": [1, 2**31]})
    assert (answer.status_code, answer.json["code"]) == (400, "invalid_parameter")
    assert "below 2147483648" in answer.json["message"]


@pytest.mark.parametrize("name", ["stack_num", "img_height", "img_width"])
def test_ataris_own_implementation_gets_no_argument_that_hangs_it(client, name):
    pytest.importorskip("ale_py")
    how = {"num_envs": 2, "vectorization_mode": "vector_entry_point"}
    for kwargs, words in (({name: 0}, f"'{name}' must be"), ({"batch_size": 3}, "'batch_size'")):
        body = {"env_id": "ALE/Pong-v5", "kwargs": kwargs, **how}
        answer = client.post("/v1/envs/", json=body)
        assert (answer.status_code, answer.json["code"]) == (400, "invalid_kwargs")
        assert words in answer.json["message"]
