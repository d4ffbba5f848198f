"""Write a model of each algorithm, as R reads it, and the actions that it takes.

Of some models there is a zip file, too, and in a folder "zip" what R reads of that. Called with a
folder and the number of observations. The models are not trained; their weights,
moments and normalizations are drawn, so that none is 0 or 1.
"""

import sys
import threading
from pathlib import Path

import gymnasium
import numpy as np
import torch
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from gym_server.sb3 import algorithms, convert, files, policies

folder, n = Path(sys.argv[1]), int(sys.argv[2])
draws = np.random.default_rng(1)
torch.manual_seed(1)
CASES = {
    **{
        name: (name, "CartPole-v1", {})
        for name in ("PPO", "A2C", "TRPO", "DQN", "QRDQN")
    },
    **{
        name: (name, "Pendulum-v1", {})
        for name in ("SAC", "TD3", "DDPG", "TQC", "CrossQ")
    },
    "PPO of a Box": ("PPO", "Pendulum-v1", {}),
    "A2C with LeakyReLU": ("A2C", "Pendulum-v1", {"activation_fn": "LeakyReLU"}),
    "PPO that explores by states": ("PPO", "Pendulum-v1", {"use_sde": True}),
    "PPO squashed": ("PPO", "Pendulum-v1", {"use_sde": True, "squash_output": True}),
    "SAC that explores by states": ("SAC", "Pendulum-v1", {"use_sde": True}),
    "normalized SAC": ("SAC", "Pendulum-v1", {}),
}
for case, (name, env_id, settings) in CASES.items():
    env = DummyVecEnv([lambda env_id=env_id: gymnasium.make(env_id)])
    if case.startswith("normalized"):
        env = VecNormalize(env)
        env.obs_rms.mean = draws.normal(size=3)
        env.obs_rms.var = draws.uniform(0.1, 2, 3)
        env.obs_rms.count = 1000.0
    settings = dict(settings)
    own = {"use_sde": settings.pop("use_sde")} if "use_sde" in settings else {}
    given = {"policy_kwargs": {"net_arch": [32, 24], **settings}, **own}
    make = algorithms.algorithm(name)
    model = make(
        "MlpPolicy",
        env,
        device="cpu",
        **algorithms.arguments_of(make, given, env.action_space),
    )
    for key, value in model.policy.state_dict().items():
        if value.is_floating_point():
            value += 0.1 * torch.randn(value.shape)
        if key.endswith("ra_var"):
            value.abs_()
    observations = draws.normal(size=(n, *env.observation_space.shape)) * 2
    observations = observations.astype(np.float32).astype(np.float64)
    seen = observations.astype(np.float32)
    exact = observations
    if isinstance(env, VecNormalize):
        seen = env.normalize_obs(seen)
        deviation = np.sqrt(env.obs_rms.var + env.epsilon)
        exact = np.clip((observations - env.obs_rms.mean) / deviation, -10, 10)
    predicted, _ = model.predict(seen, deterministic=True)
    place = folder / case
    place.mkdir()
    policies.write_network(
        place, policies.network(model), policies.moments_of(model.get_vec_normalize_env())
    )
    if case in ("SAC", "PPO of a Box", "QRDQN", "A2C with LeakyReLU"):
        model.save(place / "model.zip")
        job = {"file": str(place / "model.zip"), "activation": None, "moments": None}
        (place / "zip").mkdir()
        convert.convert(job, place / "zip", threading.Event())
    policy = model.policy.double()
    policy.set_training_mode(False)
    with torch.no_grad():
        rows = torch.as_tensor(exact)
        # Below the part that makes single precision of the observations.
        if name == "DQN":
            outputs = policy.q_net.q_net(rows)
        elif name == "QRDQN":
            outputs = policy.quantile_net.quantile_net(rows).view(n, -1, 2).mean(1)
        elif name in ("PPO", "A2C", "TRPO"):
            outputs = policy.action_net(policy.mlp_extractor.forward_actor(rows))
            outputs = torch.tanh(outputs) if policy.squash_output else outputs
        elif name in ("TD3", "DDPG"):
            outputs = policy.actor.mu(rows)
        else:
            outputs = torch.tanh(policy.actor.mu(policy.actor.latent_pi(rows)))
        outputs = outputs.numpy()
    tensors = {"observations": observations, "predicted": predicted, "outputs": outputs}
    files.write_tensors(place / "actions.safetensors", tensors, {})
