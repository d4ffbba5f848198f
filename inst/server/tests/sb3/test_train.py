"""Trainings, which run in the process with PyTorch."""

import json
import subprocess
import sys
import threading
from importlib.util import find_spec

import numpy as np
import pytest

from gym_server.protocol import safetensors

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(find_spec("sb3_contrib") is None, reason="the extra sb3 is not installed"),
]

JOB = {
    "algorithm": "PPO",
    "env_id": "CartPole-v1",
    "env_kwargs": {},
    "wrappers": [],
    "atari": False,
    "policy": "MlpPolicy",
    "arguments": {"n_steps": 32, "batch_size": 32},
    "total_steps": 200,
    "num_envs": 1,
    "normalize": False,
    "device": "cpu",
    "seed": 1,
    "eval_every": 100,
    "eval_episodes": 1,
    "checkpoint": False,
}

OF_PARTS = {
    "policy": "MultiInputPolicy",
    "wrappers": [{"name": "TimeAwareObservation", "kwargs": {"flatten": False}}],
}


def train(folder, **changes):
    from gym_server.sb3.train import train as run

    return run({**JOB, **changes}, folder, threading.Event())


def error_of_training(folder, **changes):
    try:
        train(folder, **changes)
    except Exception as error:
        return in_words(error)
    return None


def in_words(error):
    from gym_server.sb3.failures import in_words as words

    return words(error)


def steps_of(folder):
    from gym_server.sb3 import checkpoints

    return checkpoints.state_of(folder)["num_timesteps"]


def has_gpu():
    import torch

    return torch.cuda.is_available()


@pytest.mark.parametrize(
    ("changes", "argument", "words"),
    [
        ({"algorithm": "PPP"}, "algorithm", "no algorithm"),
        ({"algorithm": "SAC", "arguments": {}}, "algorithm", "cannot act in CartPole-v1"),
        (
            {"algorithm": "DQN", "env_id": "Pendulum-v1", "arguments": {}},
            "algorithm",
            "actions are a Box",
        ),
        ({"arguments": {"gama": 0.9}}, "gama", "no argument"),
        ({"arguments": {"learning_rate": "falling"}}, "learning_rate", "lin_3e-4"),
        ({"policy": "MlpPolice"}, "policy", "no policy"),
        ({"env_id": "CartPole-v99"}, "env", "no such version"),
        ({"env_kwargs": {"wind": 1}}, "env", "wind"),
        ({"device": "cuda"}, "device", "no GPU"),
        ({"algorithm": "MaskablePPO"}, "algorithm", "does not say which actions are valid"),
        ({"policy": "CnnPolicy"}, "policy", "pictures"),
        ({"env_id": "Blackjack-v1"}, "env", "cannot train in Blackjack-v1"),
        ({"arguments": {"n_steps": -1}}, "...", "refuses its arguments"),
        ({"env_id": "Taxi-v4", "normalize": True}, "normalize", "are a Discrete"),
        ({**OF_PARTS, "normalize": True}, "normalize", "are a Dict, and only a Box"),
        ({"normalize": {"gama": 0.9}}, "normalize", "no argument"),
    ],
)
def test_what_is_wrong_is_said_before_anything_is_trained(
    changes, argument, words, tmp_path, child
):
    if changes.get("device") == "cuda" and child(has_gpu):
        pytest.skip("there is a GPU")
    said = child(error_of_training, tmp_path, **changes)
    assert words in said["message"]
    assert said.get("argument") == argument
    assert not (tmp_path / "progress.csv").exists()


@pytest.mark.skipif(find_spec("mujoco") is None, reason="the extra mujoco is not installed")
def test_a_robot_is_trained_by_the_program(tmp_path):
    # A process of its own, which looks for a way to draw before PyTorch has an optimizer.
    job = {**JOB, "task": "train", "env_id": "HalfCheetah-v5", "total_steps": 32}
    path = tmp_path / "job.json"
    path.write_text(json.dumps(job))
    program = [sys.executable, "-m", "gym_server.sb3", str(path)]
    # It ends when its input is closed.
    with subprocess.Popen(program, stdin=subprocess.PIPE) as process:
        assert process.wait() == 0
    assert json.loads((tmp_path / "result.json").read_text())["steps"] == 32


def test_the_same_seed_is_the_same_training(tmp_path, child):
    policies = []
    for seed in (1, 1, 2):
        folder = tmp_path / str(len(policies))
        folder.mkdir()
        child(train, folder, seed=seed)
        policies.append((folder / "policy.safetensors").read_bytes())
    assert policies[0] == policies[1] != policies[2]


def test_a_loss_that_is_nan_ends_the_training_and_finite_weights_are_kept(tmp_path, child):
    arguments = {**JOB["arguments"], "learning_rate": 1e30}
    result = child(train, tmp_path, total_steps=2000, arguments=arguments)
    assert "NaN" in result["error"]["message"]
    read = safetensors.read((tmp_path / "policy.safetensors").read_bytes())
    assert all(np.isfinite(tensor.array()).all() for tensor in read.tensors.values())


def test_memory_that_does_not_suffice_is_said_in_words_and_the_steps_are_kept(tmp_path, child):
    arguments = {"learning_starts": 50, "buffer_size": 1000, "batch_size": 10**14}
    result = child(train, tmp_path, algorithm="DQN", arguments=arguments)
    assert "The memory does not suffice" in result["error"]["message"]
    assert "batch_size" in result["error"]["hint"]
    assert result["steps"] > 50
    assert (tmp_path / "policy.safetensors").exists()


def test_a_training_goes_on_with_its_weights_steps_and_buffer(tmp_path, child):
    off_policy = {"learning_starts": 50, "buffer_size": 1000}
    changes = {"algorithm": "DQN", "arguments": off_policy, "checkpoint": True}
    # Without moments of observations.
    changes["normalize"] = {"norm_obs": False}
    assert child(train, tmp_path, **changes)["begun"] == 0
    assert child(steps_of, tmp_path) == 200
    with np.load(tmp_path / "checkpoint" / "buffer.npz") as buffer:
        assert len(buffer["rewards"]) == 200
    result = child(train, tmp_path, **changes, total_steps=300)
    assert (result["begun"], result["steps"]) == (200, 300)
    with np.load(tmp_path / "checkpoint" / "buffer.npz") as buffer:
        assert len(buffer["rewards"]) == 300
    (tmp_path / "checkpoint" / "model.zip").write_bytes(b"half of it")
    said = child(error_of_training, tmp_path, **changes, total_steps=400)
    assert "is damaged" in said["message"]
    assert said["checkpoint"]
