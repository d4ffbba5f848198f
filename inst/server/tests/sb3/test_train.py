"""Jobs with errors, in one process: PyTorch takes seconds to import."""

import threading

import pytest

pytestmark = pytest.mark.slow
pytest.importorskip("sb3_contrib", reason="the extra sb3 is not installed")

JOB = {
    "algorithm": "PPO",
    "env_id": "CartPole-v1",
    "env_kwargs": {},
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


def train(folder, **changes):
    from gym_server.sb3.train import train as run

    return run({**JOB, **changes}, folder, threading.Event())


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
        ({"arguments": {"policy_kwargs": {"activation_fn": "ELU"}}}, "policy", "activation ELU"),
        ({"env_id": "Blackjack-v1"}, None, "not supported"),
    ],
)
def test_what_is_wrong_is_said_before_anything_is_trained(changes, argument, words, tmp_path):
    import torch

    from gym_server.sb3.failures import in_words

    if changes.get("device") == "cuda" and torch.cuda.is_available():
        pytest.skip("there is a GPU")
    with pytest.raises(Exception) as caught:
        train(tmp_path, **changes)
    said = in_words(caught.value)
    assert words in said["message"]
    assert said.get("argument") == argument
    assert not (tmp_path / "progress.csv").exists()


def test_a_loss_that_is_nan_ends_the_training_and_finite_weights_are_kept(tmp_path):
    import numpy as np

    from gym_server.protocol import safetensors

    result = train(
        tmp_path, total_steps=2000, arguments={**JOB["arguments"], "learning_rate": 1e30}
    )
    assert "NaN" in result["error"]["message"]
    assert not result["complete"]
    read = safetensors.read((tmp_path / "policy.safetensors").read_bytes())
    assert all(np.isfinite(tensor.array()).all() for tensor in read.tensors.values())


def test_memory_that_does_not_suffice_is_said_in_words():
    from gym_server.sb3.failures import in_words

    said = in_words(MemoryError("Unable to allocate 1.5 TiB"))
    assert "The memory does not suffice" in said["message"]
    assert "buffer_size" in said["hint"]


def test_a_training_goes_on_with_its_weights_steps_and_buffer(tmp_path):
    import numpy as np

    from gym_server.sb3 import checkpoints

    off_policy = {"learning_starts": 50, "buffer_size": 1000}
    changes = {"algorithm": "DQN", "arguments": off_policy, "checkpoint": True}
    assert train(tmp_path, **changes)["begun"] == 0
    assert checkpoints.steps_of(tmp_path) == 200
    with np.load(tmp_path / "checkpoint" / "buffer.npz") as buffer:
        assert len(buffer["rewards"]) == 200
    result = train(tmp_path, **changes, total_steps=300)
    assert (result["begun"], result["steps"]) == (200, 300)
    with np.load(tmp_path / "checkpoint" / "buffer.npz") as buffer:
        assert len(buffer["rewards"]) == 300
