"""Policies that stay with Stable-Baselines3, against the library's own evaluation; zip files."""

import json
import pickle
import threading
import zipfile
from importlib.util import find_spec

import numpy as np
import pytest

from gym_server.protocol import safetensors

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(find_spec("sb3_contrib") is None, reason="the extra sb3 is not installed"),
]

JOB = {"env_kwargs": {}, "wrappers": [], "atari": False, "num_envs": 1, "arguments": {}}
SEEDS = [1, 2, 3]


def game():
    import ale_py
    import gymnasium
    from stable_baselines3.common.atari_wrappers import AtariWrapper

    gymnasium.register_envs(ale_py)
    env = gymnasium.make("ALE/Pong-v5", frameskip=1, max_num_frames_per_episode=200)
    return AtariWrapper(env, terminal_on_life_loss=False, clip_reward=False)


def pole():
    import gymnasium

    return gymnasium.make("CartPole-v1")


def timed_pole():
    from gymnasium.wrappers import TimeAwareObservation

    return TimeAwareObservation(pole(), flatten=False, normalize_time=True)


def taxi():
    import gymnasium
    from sb3_contrib.common.wrappers import ActionMasker

    return ActionMasker(
        gymnasium.make("Taxi-v4", max_episode_steps=30),
        lambda env: env.unwrapped.action_mask(env.unwrapped.s),
    )


CASES = {
    "convolutional": (
        {
            **{"algorithm": "PPO", "policy": "CnnPolicy", "env_id": "ALE/Pong-v5", "atari": True},
            "env_kwargs": {"max_num_frames_per_episode": 200},
        },
        game,
    ),
    "recurrent": (
        {
            **{"algorithm": "RecurrentPPO", "policy": "MlpLstmPolicy", "env_id": "CartPole-v1"},
            "arguments": {"policy_kwargs": {"lstm_hidden_size": 8, "activation_fn": "ReLU"}},
        },
        pole,
    ),
    "of masked actions": (
        {
            **{"algorithm": "MaskablePPO", "policy": "MlpPolicy", "env_id": "Taxi-v4"},
            "env_kwargs": {"max_episode_steps": 30},
        },
        taxi,
    ),
    "of several parts": (
        {
            **{"algorithm": "DQN", "policy": "MultiInputPolicy", "env_id": "CartPole-v1"},
            "wrappers": [
                {
                    "name": "TimeAwareObservation",
                    "kwargs": {"flatten": False, "normalize_time": True},
                }
            ],
            "arguments": {"buffer_size": 10},
        },
        timed_pole,
    ),
}


def compare(folder, case):
    """Return returns and lengths, here and by Stable-Baselines3, and actions likewise."""
    import torch
    from sb3_contrib.common.maskable.evaluation import evaluate_policy as evaluate_masked
    from stable_baselines3.common.evaluation import evaluate_policy
    from stable_baselines3.common.running_mean_std import RunningMeanStd
    from stable_baselines3.common.vec_env import DummyVecEnv, VecFrameStack, VecNormalize

    from gym_server.sb3 import algorithms, convert, environments, play, policies
    from gym_server.spaces import stack, tensor_writer

    changes, make_env = CASES[case]
    job = {**JOB, **changes}
    make = algorithms.algorithm(job["algorithm"])
    env = environments.vector_env(job)
    reference = DummyVecEnv([make_env])
    if case == "convolutional":
        reference = VecFrameStack(reference, 4)
    if case == "recurrent":
        moments = RunningMeanStd(shape=(4,))
        moments.mean, moments.var = np.arange(4) / 10, np.arange(1.0, 5.0)
        env, reference = VecNormalize(env), VecNormalize(reference, norm_reward=False)
        env.obs_rms = reference.obs_rms = moments
        reference.training = False
    arguments = algorithms.arguments_of(make, job["arguments"], env.action_space)
    model = make(job["policy"], env, seed=1, device="cpu", **arguments)
    torch.manual_seed(2)
    for value in model.policy.state_dict().values():
        # The first weights are so small that every observation would have the same action.
        value += 0.1 * torch.randn(value.shape)
    policies.write(folder, model, job)
    asked = {**job, "seeds": SEEDS, "max_steps": None, "keep": ["steps"], "frames": False}
    assert play.play(asked, folder, threading.Event()) == {"error": None}
    played = safetensors.read((folder / "episodes.safetensors").read_bytes()).tensors
    expected = []
    for seed in SEEDS:
        reference.seed(seed)
        evaluate = evaluate_masked if case == "of masked actions" else evaluate_policy
        rewards, lengths = evaluate(model, reference, 1, return_episode_rewards=True, warn=False)
        expected.append((rewards[0], lengths[0]))

    space = environments.single_env(job).observation_space
    space.seed(1)
    drawn = stack(space, [space.sample() for _ in range(300)])
    seen = env.normalize_obs(drawn) if case == "recurrent" else drawn
    sent = tensor_writer(space, "observation", is_batch=True)(drawn, False).tensors
    (folder / "observations.safetensors").write_bytes(safetensors.write(sent, {}))
    play.act({**job, "count": 300}, folder, threading.Event())
    acted = safetensors.read((folder / "actions.safetensors").read_bytes()).tensors["action"]

    # A zip file of the model has the same policy.
    model.save(folder / "model.zip")
    given = {"mean": moments.mean, "variance": moments.var} if case == "recurrent" else None
    weights = (folder / "policy.safetensors").read_bytes()
    zipped = {"file": str(folder / "model.zip"), "activation": None, "moments": given}
    convert.convert(zipped, folder, threading.Event())
    converted = safetensors.read((folder / "policy.safetensors").read_bytes())
    for name, tensor in safetensors.read(weights).tensors.items():
        np.testing.assert_allclose(converted.tensors[name].array(), tensor.array(), err_msg=name)
    play.act({**job, "count": 300}, folder, threading.Event())
    again = safetensors.read((folder / "actions.safetensors").read_bytes()).tensors["action"]
    assert again.data == acted.data
    return (
        list(
            zip(played["return"].array().tolist(), played["length"].array().tolist(), strict=True)
        ),
        expected,
        acted.array().tolist(),
        model.predict(seen, deterministic=True)[0].tolist(),
    )


@pytest.mark.parametrize("case", CASES)
def test_a_policy_that_is_no_network_plays_as_in_stable_baselines3(case, tmp_path, child):
    played, expected, acted, predicted = child(compare, tmp_path, case)
    assert played == expected
    assert acted == predicted
    assert len(set(acted)) > 1


def error_of_converting(folder, part):
    from gym_server.sb3 import convert, failures

    job = {"file": str(folder / "model.zip"), "activation": None, "moments": None}
    try:
        convert.convert(job, folder, threading.Event())
    except Exception as error:
        return failures.in_words(error)[part]
    return None


class Harm:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (self.path, "w")


def test_a_zip_file_with_a_pickle_instead_of_weights_is_not_loaded(tmp_path, child):
    ran = tmp_path / "ran"
    with zipfile.ZipFile(tmp_path / "model.zip", "w") as archive:
        archive.writestr("data", json.dumps({"action_space": {":type:": "Box"}}))
        archive.writestr("policy.pth", pickle.dumps(Harm(str(ran))))
    assert "is not loaded" in child(error_of_converting, tmp_path, "hint")
    assert not ran.exists()
    (tmp_path / "model.zip").write_text("no zip")
    assert "no model that Stable-Baselines3 saved" in child(
        error_of_converting, tmp_path, "message"
    )
