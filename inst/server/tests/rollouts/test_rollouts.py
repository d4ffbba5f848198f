"""Rollouts give the same episodes as playing by hand."""

import gymnasium
import numpy as np
import pytest
from rollout_requests import RANDOM, played_by_hand, refused, request_body, roll_out

from gym_server.errors import GymServerError
from gym_server.protocol.safetensors import COLUMN_TENSORS, TENSORS

SEEDS = [3, 2**40, 3, 0]

# Linear policies: for discrete observations, for a Box, and for a Box of actions.
LUNAR = {"kind": "network", "sizes": [8, 4], "activation": ["identity"], "bias": True}


@pytest.mark.parametrize(
    ("env_id", "max_steps"),
    [
        ("FrozenLake-v1", None),
        ("Blackjack-v1", None),
        ("Taxi-v4", 30),
        ("LunarLander-v3", None),
        ("BipedalWalker-v3", 40),
        ("Pendulum-v1", 20),
        ("MountainCarContinuous-v0", 20),
        ("HalfCheetah-v5", 20),
    ],
)
def test_they_are_those_played_by_hand_in_new_environments(client, env_id, max_steps):
    arrays, _ = roll_out(
        client, SEEDS, env_id=env_id, max_steps=max_steps, keep=["steps", "next_observation"]
    )
    episodes = played_by_hand(env_id, SEEDS, max_steps)
    assert arrays["length"].tolist() == [len(steps) for steps in episodes]
    assert arrays["return"].tolist() == [sum(step[2] for step in steps) for steps in episodes]
    last = [steps[-1] for steps in episodes]
    assert arrays["terminated"].tolist() == [bool(step[3]) for step in last]
    assert arrays["truncated"].tolist() == [bool(step[4] or not step[3]) for step in last]
    steps = [step for steps in episodes for step in steps]
    assert arrays["step/reward"].tolist() == [step[2] for step in steps]
    assert arrays["step/terminated"].tolist() == [bool(step[3]) for step in steps]
    for name, column in (("observation", 0), ("action", 1), ("next_observation", 5)):
        values = [step[column] for step in steps]
        if isinstance(values[0], tuple):
            parts = [arrays[f"{name}/{part}"] for part in range(len(values[0]))]
            assert [tuple(map(int, row)) for row in zip(*parts, strict=True)] == [
                tuple(map(int, value)) for value in values
            ]
        else:
            assert np.array_equal(arrays[name], np.array(values))


def test_a_group_is_the_first_episodes_of_the_implementation_of_its_own(client):
    rows = np.arange(0, 256, 5, dtype=np.int32)
    tensors = {"row": rows, "policy/weights": np.array([[0.0, 0, 0, 0, 0.1, 0.2, 1, 1]])}
    policy = {"kind": "network", "sizes": [4, 2], "activation": ["identity"], "bias": False}
    arrays, _ = roll_out(
        client,
        [7] * len(rows),
        env_id="CartPole-v1",
        policy=policy,
        tensors=tensors,
        keep=["moments", "steps", "next_observation"],
    )
    env = gymnasium.make_vec("CartPole-v1", 256, vectorization_mode="vector_entry_point")
    weights = tensors["policy/weights"].reshape(4, 2).T
    observation, _ = env.reset(seed=7)
    lengths = np.zeros(256, int)
    running = np.ones(256, bool)
    seen = [[] for _ in range(256)]
    while running[rows].any():
        for row in rows[running[rows]]:
            seen[row].append(observation[row])
        action = (observation.astype(np.float64) @ weights.T).argmax(axis=1)
        observation, _, terminated, truncated, _ = env.step(action)
        lengths += running
        running &= ~(terminated | truncated)
    assert arrays["length"].tolist() == lengths[rows].tolist()
    assert arrays["return"].tolist() == lengths[rows].tolist()
    observed = np.concatenate([np.array(seen[row]) for row in rows])
    assert np.array_equal(arrays["observation"], observed)
    first = np.array(seen[0], dtype=np.float64)
    assert np.allclose(arrays["moments/mean"][0], first.mean(axis=0))
    assert np.allclose(
        arrays["moments/squares"][0], ((first - first.mean(axis=0)) ** 2).sum(axis=0)
    )
    assert arrays["moments/count"][0] == len(first)


def test_no_result_depends_on_how_it_was_asked_for(quick, monkeypatch):
    rng = np.random.default_rng(1)
    seeds = rng.integers(0, 1000, 40)
    candidate = rng.integers(0, 3, 40).astype(np.int32)
    weights = rng.normal(size=(3, 36))
    how = {"env_id": "LunarLander-v3", "policy": LUNAR, "max_steps": 60, "keep": ["moments"]}

    def play(client, which):
        tensors = {"candidate": candidate[which], "policy/weights": weights}
        return roll_out(client, seeds[which], tensors=tensors, **how)[0]

    one = quick(max_processes=1).test_client()
    monkeypatch.setenv("PYTHON_CPU_COUNT", "3")
    three = quick().test_client()
    together = play(one, np.arange(40))
    assert len(set(together["return"].tolist())) > 30
    shuffled = rng.permutation(40)
    pieces = [play(three, which) for which in np.array_split(shuffled, [1, 3, 11, 30])]
    for name, array in together.items():
        apart = np.concatenate([piece[name] for piece in pieces])
        assert np.array_equal(apart, array[shuffled]), name


def test_a_group_does_not_depend_on_the_rows_that_are_asked_for(client):
    rng = np.random.default_rng(2)
    weights = rng.normal(size=(52, 10))
    row = np.arange(256, dtype=np.int32)
    candidate = (row // 5).astype(np.int32)
    policy = {"kind": "network", "sizes": [4, 2, 1], "activation": ["tanh", "logistic"]}

    def play(which):
        tensors = {
            "row": row[which],
            "candidate": candidate[which],
            "policy/weights": weights,
        }
        how = {"env_id": "CartPole-v1", "policy": policy, "keep": ["moments"]}
        return roll_out(client, [11] * len(row[which]), tensors=tensors, **how)[0]

    together = play(slice(None))
    some = play(slice(100, 130))
    for name, array in together.items():
        assert np.array_equal(some[name], array[100:130]), name


def test_moments_are_those_of_the_observations_that_were_acted_on(client):
    arrays, _ = roll_out(
        client, range(5), env_id="Pendulum-v1", max_steps=30, keep=["moments", "steps"]
    )
    for episode in range(5):
        own = arrays["observation"][30 * episode : 30 * episode + 30].astype(np.float64)
        assert arrays["moments/count"][episode] == 30
        assert np.allclose(arrays["moments/mean"][episode], own.mean(axis=0))
        squares = ((own - own.mean(axis=0)) ** 2).sum(axis=0)
        assert np.allclose(arrays["moments/squares"][episode], squares)


def test_moments_of_large_observations_are_merged(client, monkeypatch):
    how = {"env_id": "Pendulum-v1", "max_steps": 30, "keep": ["moments"]}
    together = roll_out(client, [1], **how)[0]
    from gym_server.rollouts import recording

    space = gymnasium.spaces.Box(-1, 1, (3,))
    monkeypatch.setattr(recording, "_NUMBERS_AT_ONCE", 12)
    merged = recording.Moments(space)
    steps = played_by_hand("Pendulum-v1", [1], 30)[0]
    for step in steps:
        merged.add(step[0])
    count, mean, squares = merged.result()
    assert count == together["moments/count"][0]
    assert np.allclose(mean, together["moments/mean"][0])
    assert np.allclose(squares, together["moments/squares"][0])


def test_tensors_by_column_are_transposed(client):
    how = {"env_id": "Pendulum-v1", "max_steps": 3, "keep": ["steps"]}
    by_row = roll_out(client, [1, 2], **how)[0]
    by_column = roll_out(client, [1, 2], accept=COLUMN_TENSORS, **how)[0]
    assert by_row["observation"].shape == (6, 3)
    assert np.array_equal(by_column["observation"], by_row["observation"].T)
    assert np.array_equal(by_column["return"], by_row["return"])


def test_wrappers_and_arguments_are_the_environments_own(client):
    how = {
        "env_id": "FrozenLake-v1",
        "kwargs": {"is_slippery": False, "map_name": "8x8"},
        "wrappers": [{"name": "TimeLimit", "kwargs": {"max_episode_steps": 4}}],
    }
    arrays, _ = roll_out(client, range(10), **how)
    assert arrays["length"].max() == 4
    answer = client.post("/v1/rollouts/", json=how).json
    assert answer["spec"]["max_episode_steps"] == 4
    assert answer["spec"]["kwargs"] == how["kwargs"]
    assert answer["observation_space"]["n"] == 64


def test_the_description_is_that_of_an_instance(client, create):
    for env_id in ("LunarLander-v3", "CartPole-v1", "Blackjack-v1", "Taxi-v4"):
        described = client.post("/v1/rollouts/", json={"env_id": env_id}).json
        about = client.get(create(env_id) + "/").json
        for name in ("env_id", "observation_space", "action_space"):
            assert described[name] == about[name]
        for name in ("kwargs", "wrappers", "max_episode_steps", "reward_threshold", "render_fps"):
            assert described["spec"][name] == about[name]
        assert described["group"] == (256 if env_id == "CartPole-v1" else None)
        assert described["needs_max_steps"] is False
        assert described["processes"] >= 1


@pytest.mark.parametrize(
    ("env_id", "kwargs", "needs"),
    [
        ("CliffWalking-v1", {}, True),
        ("ALE/Pong-v5", {}, False),
        ("ALE/Pong-v5", {"max_num_frames_per_episode": 0}, True),
    ],
)
def test_what_has_no_end_needs_a_limit(client, env_id, kwargs, needs):
    how = {"env_id": env_id, "kwargs": kwargs}
    assert client.post("/v1/rollouts/", json=how).json["needs_max_steps"] is needs


def test_an_environment_that_changes_its_arrays_in_place_is_kept_as_it_was(client):
    arrays, _ = roll_out(
        client, [1], env_id="faulty_envs:KeepsItsArrays-v0", keep=["steps"], max_steps=4
    )
    assert arrays["observation"].ravel().tolist() == [0, 1, 2]


def test_foreign_environments_are_made_anew_for_each_episode(client):
    how = {"env_id": "faulty_envs:Counting-v0", "keep": ["steps"], "max_steps": 3}
    arrays, _ = roll_out(client, [1, 2], **how)
    assert arrays["observation"].ravel().tolist() == [0, 1, 2, 0, 1, 2]


# Refusals -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "code", "words"),
    [
        ({"env_id": "Nope-v1"}, "unknown_env_id", "Nope-v1"),
        ({"env_id": "CliffWalking-v1"}, "invalid_parameter", "max_steps"),
        ({"max_steps": 0}, "invalid_parameter", "max_steps"),
        ({"keep": ["frames"]}, "invalid_parameter", "moments, steps, next_observation"),
        ({"wrappers": [{"name": "NormalizeReward"}]}, "not_supported", "remembers"),
        ({"policy": {"kind": "wish"}}, "invalid_policy", "wish"),
        ({"tensors": {"candidate": np.array([1])}}, "invalid_parameter", "2 integers"),
        ({"tensors": {"candidate": np.array([0, -1])}}, "invalid_parameter", "not -1"),
        ({"tensors": {"row": np.array([0, 256])}}, "invalid_parameter", "from 0 to 255"),
        ({"tensors": {"row": np.array([0, 1])}}, "invalid_parameter", "'row'"),
        ({"env_id": "CartPole-v1"}, "missing_parameter", "'row'"),
        (
            {"env_id": "Blackjack-v1", "keep": ["moments"]},
            "not_supported",
            "have moments",
        ),
        ({"env_id": "faulty_envs:RaisesInStep-v0", "max_steps": 9}, "environment_error", "seed 1"),
        ({"env_id": "faulty_envs:ExitsInStep-v0", "max_steps": 9}, "environment_error", "seed 1"),
        ({"env_id": "other:Thing-v0"}, "module_not_allowed", "other"),
    ],
)
def test_what_cannot_be_played_is_refused_in_words(client, fields, code, words):
    refusal = refused(client, [1, 1], **fields)
    assert refusal["code"] == code
    assert words in refusal["message"]


def test_episodes_need_a_policy_and_a_seed(client):
    refusal = refused(client, [1], policy=None)
    assert (refusal["code"], "policy" in refusal["message"]) == ("missing_parameter", True)
    assert "no episodes" in refused(client, [])["message"]
    answer = client.post("/v1/rollouts/", data=b"no tensors", content_type=TENSORS)
    assert answer.json["code"] == "malformed_tensors"


def test_what_was_finished_before_an_error_is_answered(client):
    # It raises when the action is 1; with these seeds that comes later.
    how = {"env_id": "faulty_envs:RaisesInStep-v0", "max_steps": 1}
    arrays, metadata = roll_out(client, range(100, 150), **how)
    finished = len(arrays["return"])
    assert 0 < finished < 50
    assert f"seed {100 + finished}" in metadata["error"]
    assert "the pole broke" in metadata["error"]
    # No episode is missing: the next one fails by itself.
    assert refused(client, [100 + finished], **how)["code"] == "environment_error"


def test_an_answer_has_no_more_than_so_many_bytes(client, monkeypatch):
    monkeypatch.setattr("gym_server.manager.rollout_request.MOST_BYTES", 20_000)
    how = {"env_id": "Pendulum-v1", "max_steps": 100, "keep": ["steps"]}
    arrays, metadata = roll_out(client, range(100), **how)
    finished = len(arrays["return"])
    assert 0 < finished < 100
    assert metadata == {}
    assert len(arrays["observation"]) == 100 * finished
    whole = roll_out(client, [finished - 1], **how)[0]
    assert whole["return"][0] == arrays["return"][-1]


def test_the_steps_of_an_episode_have_no_more_than_so_many_bytes(monkeypatch):
    from gym_server.rollouts import recording
    from gym_server.rollouts.task import Keep

    monkeypatch.setattr(recording, "MOST_BYTES", 100)
    box = gymnasium.spaces.Box(-1, 1, (3,))
    recorder = recording.Recorder(Keep(steps=True), box, box)
    for _ in range(4):
        recorder.before(np.zeros(3), np.zeros(3))
        recorder.after(np.zeros(3), 1.0, False, False)
    recorder.before(np.zeros(3), np.zeros(3))
    with pytest.raises(GymServerError, match="is longer"):
        recorder.after(np.zeros(3), 1.0, False, False)


def test_the_body_says_what_is_asked(client):
    body = request_body([1], env_id="FrozenLake-v1", policy=RANDOM)
    assert client.post("/v1/rollouts/", data=body, content_type=TENSORS).status_code == 200
