"""Games as ale-py's vector environment steps them for a training, against those of one by one."""

from importlib.util import find_spec

import pytest

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(find_spec("sb3_contrib") is None, reason="the extra sb3 is not installed"),
]


def played(env_id, steps, **kwargs):
    """Return what two games of random actions said in each step, and one sum over its pictures."""
    import numpy as np

    from gym_server.sb3.atari import AtariVecEnv
    from gym_server.sb3.environments import vector_env

    job = {"algorithm": "PPO", "env_id": env_id, "env_kwargs": kwargs, "wrappers": []}
    games = vector_env({**job, "atari": True, "num_envs": 2})
    assert isinstance(games, AtariVecEnv)
    games.seed(1)
    pictures = games.reset()
    draws = np.random.default_rng(2)
    said, total = [], 0
    for _ in range(steps):
        before = pictures
        pictures, rewards, dones, infos = games.step(draws.integers(games.action_space.n, size=2))
        total += int(pictures.sum())
        said += [
            {
                "game": i,
                "reward": float(rewards[i]),
                "done": bool(dones[i]),
                "truncated": infos[i].get("TimeLimit.truncated"),
                "episode": infos[i].get("episode"),
                # The newest three of the four pictures before it are the oldest three at the end.
                "ends_in_its_own": bool(
                    dones[i] and np.array_equal(infos[i]["terminal_observation"][:3], before[i][1:])
                ),
            }
            for i in range(2)
        ]
    shape = pictures.shape
    games.close()
    return said, total, shape


def test_an_episode_ends_with_a_life_and_a_score_is_that_of_a_whole_game(child):
    said, _, shape = child(played, "ALE/Breakout-v5", 1500)
    assert shape == (2, 4, 84, 84)
    for game in range(2):
        own = [step for step in said if step["game"] == game]
        lives, score, games = 0, 0.0, 0
        for step in own:
            lives += step["done"]
            score += step["reward"]
            if step["episode"] is not None:
                # Random play breaks bricks of the lowest rows, which count one each.
                assert (lives, score) == (5, step["episode"]["r"])
                assert step["episode"]["l"] > 100
                lives, score, games = 0, 0.0, games + 1
        assert games >= 2
    assert all(step["ends_in_its_own"] for step in said if step["done"])


def test_rewards_are_clipped_and_scores_are_not(child):
    said, _, _ = child(played, "ALE/Qbert-v5", 700)
    assert {step["reward"] for step in said} == {0, 1}
    assert all(step["episode"]["r"] >= 25 for step in said if step["episode"])
    assert any(step["episode"] for step in said)


def test_a_game_that_is_cut_off_is_truncated_and_seeds_repeat(child):
    first, second = (
        child(played, "ALE/Pong-v5", 110, max_num_frames_per_episode=400) for _ in range(2)
    )
    ends = [step for step in first[0] if step["done"]]
    assert ends
    assert all(step["truncated"] and step["episode"]["l"] >= 400 for step in ends)
    assert first == second


def batches(make):
    import numpy as np
    import torch
    from gymnasium.spaces import Box, Discrete

    draws = np.random.default_rng(1)
    pictures = Box(0, 255, (4, 6, 6), np.uint8)
    buffer = make(5, pictures, Discrete(3), device="cpu", gae_lambda=0.9, gamma=0.9, n_envs=3)
    found = []
    for _ in range(2):
        buffer.reset()
        for _ in range(5):
            values, chances = torch.as_tensor(draws.normal(size=(2, 3)))
            buffer.add(
                draws.integers(256, size=(3, 4, 6, 6)),
                draws.integers(3, size=3),
                draws.normal(size=3),
                draws.random(3) < 0.3,
                values,
                chances,
            )
        buffer.compute_returns_and_advantage(values, draws.random(3) < 0.3)
        np.random.seed(3)
        for _ in range(2):
            for batch in buffer.get(4):
                found.append([(str(part.dtype), part.tolist()) for part in batch])
    return found


def both():
    from stable_baselines3.common.buffers import RolloutBuffer

    from gym_server.sb3.buffers import DeviceRolloutBuffer

    return batches(RolloutBuffer), batches(DeviceRolloutBuffer)


def test_batches_on_the_device_are_those_of_stable_baselines3(child):
    theirs, ours = child(both)
    assert len(ours) == 2 * 2 * 4
    assert ours == theirs
