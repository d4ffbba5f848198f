"""The choice of the number of processes."""

import faulty_envs  # noqa: F401 - registers Counting-v0
import gymnasium
import pytest

from gym_server.envs.config import EnvConfig
from gym_server.vector_envs import num_workers


@pytest.mark.parametrize(
    ("env_id", "num_envs", "processes"),
    [
        ("CartPole-v1", 64, 0),
        ("CartPole-v1", 256, 4),
        ("Acrobot-v1", 64, 3),
        ("Counting-v0", 64, 4),
        ("Counting-v0", 31, 0),
    ],
)
def test_processes_run_what_takes_longer_than_a_message(monkeypatch, env_id, num_envs, processes):
    monkeypatch.setattr(num_workers, "usable_cores", lambda: 4)
    config = EnvConfig(env_id, num_envs=num_envs, max_workers=4)
    assert num_workers.choose_num_workers(config, gymnasium.spec(env_id)) == processes
