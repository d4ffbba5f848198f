import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from gym_server.instances.episode_statistics import (
    EpisodeStatistics,
    VectorEpisodeStatistics,
)


def standing(statistics, sub_env):
    found = statistics.of(sub_env)
    return found["episode"], found["step"], found["return"], found["state"] == "ended"


def play(statistics, rewards, ends=True):
    statistics.begin()
    for index, reward in enumerate(rewards):
        statistics.step(reward, ends and index == len(rewards) - 1)


def test_an_episode_is_counted_from_its_reset():
    statistics = EpisodeStatistics()
    assert standing(statistics, 0) == (0, 0, 0.0, False)
    statistics.begin()
    assert standing(statistics, 0) == (1, 0, 0.0, False)
    statistics.step(1.5, False)
    statistics.step(2.0, True)
    assert standing(statistics, 0) == (1, 2, 3.5, True)
    statistics.begin()
    assert standing(statistics, 0) == (2, 0, 0.0, False)


def test_watchers_are_told_of_the_episode_and_the_returns_before_it():
    statistics = EpisodeStatistics()
    play(statistics, [1, 2])
    play(statistics, [5], ends=False)
    assert statistics.of(0) == {
        "state": "running",
        "episode": 2,
        "step": 1,
        "return": 5.0,
        "returns": [3.0],
    }


def test_a_reset_that_follows_a_reset_begins_no_other_episode():
    statistics = EpisodeStatistics()
    statistics.begin()
    statistics.begin()
    assert statistics.of(0)["episode"] == 1


def test_returns_are_of_episodes_that_ended():
    statistics = EpisodeStatistics()
    play(statistics, [1, 2])
    play(statistics, [5], ends=False)
    play(statistics, [4])
    assert list(statistics.returns) == [3, 4]
    assert statistics.of(0)["episode"] == 3


def test_steps_after_the_end_count_for_nothing():
    statistics = EpisodeStatistics()
    play(statistics, [1])
    statistics.step(7, True)
    assert standing(statistics, 0) == (1, 1, 1.0, True)
    assert list(statistics.returns) == [1]


def test_the_last_hundred_returns_are_kept():
    statistics = EpisodeStatistics()
    for number in range(130):
        play(statistics, [number])
    assert list(statistics.returns) == list(range(30, 130))


def sub_envs_of(mode, sub_envs=3):
    statistics = VectorEpisodeStatistics(sub_envs, mode)
    statistics.begin(None)
    return statistics


def step(statistics, rewards, ended, sub_envs=None):
    rows = None if sub_envs is None else np.array(sub_envs)
    statistics.step(np.array(rewards, dtype=float), np.array(ended, dtype=bool), rows)


def test_the_step_that_resets_a_sub_env_is_no_step_of_its_episode():
    statistics = sub_envs_of(AutoresetMode.NEXT_STEP)
    step(statistics, [1, 1, 1], [0, 1, 0])
    assert standing(statistics, 1) == (1, 1, 1.0, True)
    step(statistics, [1, 0, 1], [0, 0, 0])
    assert standing(statistics, 1) == (2, 0, 0.0, False)
    assert standing(statistics, 0) == (1, 2, 2.0, False)
    step(statistics, [1, 1, 1], [1, 0, 0])
    assert standing(statistics, 1) == (2, 1, 1.0, False)
    assert list(statistics.returns) == [1, 3]


def test_a_sub_env_that_resets_at_once_is_in_its_next_episode():
    statistics = sub_envs_of(AutoresetMode.SAME_STEP)
    step(statistics, [2, 1, 1], [1, 0, 0])
    assert standing(statistics, 0) == (2, 0, 0.0, False)
    step(statistics, [3, 1, 1], [1, 1, 0])
    assert list(statistics.returns) == [2, 3, 2]


def test_sub_envs_reset_by_a_mask_begin_anew_and_others_go_on():
    statistics = sub_envs_of(AutoresetMode.DISABLED)
    step(statistics, [1, 1, 1], [1, 0, 0])
    step(statistics, [5, 6], [0, 1], sub_envs=[1, 2])
    statistics.begin(np.array([True, False, False]))
    assert [standing(statistics, sub_env) for sub_env in range(3)] == [
        (2, 0, 0.0, False),
        (1, 2, 6.0, False),
        (1, 2, 7.0, True),
    ]
    assert list(statistics.returns) == [1, 7]


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_sub_envs_return_what_the_environment_gave(client, sub_envs, app, mode):
    url = sub_envs(num_envs=3, autoreset_mode=mode, vectorization_mode="sync")
    client.post(f"{url}/reset/", json={"seed": 1})
    so_far, returns, over = np.zeros(3), [], np.zeros(3, dtype=bool)
    for _ in range(30):
        action = client.get(f"{url}/action_space/sample").json["action"]
        out = client.post(f"{url}/step/", json={"action": action}).json
        so_far += out["reward"]
        so_far[over] = 0
        done = np.array(out["done"])
        returns += so_far[done].tolist()
        over = done if mode == "NextStep" else np.zeros(3, dtype=bool)
        if mode == "SameStep":
            so_far[done] = 0
    statistics = app._instances.get(url.rsplit("/", 1)[1]).statistics
    assert len(returns) > 10
    assert list(statistics.returns) == pytest.approx(returns)
