"""Make tests/testthat/gradient_updates.json: ten updates of PPO and of DQN on stored data.

Each is made twice: by Stable-Baselines3's PPO.train() and DQN.train() with double precision, and by
in_numpy.py, which does not use torch and also has double DQN. The script fails if the two
differ. test-agent-gradient-updates.R compares the agents with both.

    python3 -m venv sb3 && sb3/bin/pip install stable-baselines3==2.9.2
    sb3/bin/python tools/learn/updates.py

It asks Rscript which rows of its memory agent_dqn() draws.
"""

import itertools
import json
import subprocess
import sys

import gymnasium
import numpy as np
import stable_baselines3 as sb3
import torch
from in_numpy import forward, numpy_dqn, numpy_ppo, vector
from stable_baselines3.common.logger import configure
from stable_baselines3.common.torch_layers import FlattenExtractor

UPDATES = 10
LOGGED = (
    "approx_kl",
    "clip_fraction",
    "entropy_loss",
    "policy_gradient_loss",
    "value_loss",
    "loss",
)
rng = np.random.default_rng(40)


class InDoubles(FlattenExtractor):
    """Keeps double precision: Stable-Baselines3 passes observations in single precision."""

    def forward(self, observations):
        """Flatten as the base class does, and convert to double precision."""
        return super().forward(observations).double()


class Nothing(gymnasium.Env):
    """An environment that has only spaces."""

    def __init__(self, observation_space, action_space):
        self.observation_space = observation_space
        self.action_space = action_space


def box(size, bound=np.inf):
    """Make a space of vectors."""
    return gymnasium.spaces.Box(-bound, bound, (size,), np.float32)


def coarse(values):
    """Round to numbers that single precision can represent, and that are short in a file."""
    return np.round(values * 256) / 256


# Weights: a list of matrices with a row for each neuron, the last column is the bias --------------


def draw_weights(sizes):
    """Draw the weights of a network."""
    pairs = itertools.pairwise(sizes)
    return [coarse(rng.normal(0, 0.7, (after, before + 1))) for before, after in pairs]


def into_torch(layers, *modules):
    """Put weights into the linear layers of modules."""
    linear = [m for module in modules for m in module.modules() if hasattr(m, "bias")]
    for weights, module in zip(layers, linear, strict=True):
        module.weight.data = torch.from_numpy(weights[:, :-1].copy())
        module.bias.data = torch.from_numpy(weights[:, -1].copy())


def from_torch(*modules):
    """Read the weights of the linear layers of modules."""
    linear = [m for module in modules for m in module.modules() if hasattr(m, "bias")]
    return [np.column_stack([m.weight.detach().numpy(), m.bias.detach().numpy()]) for m in linear]


# Stable-Baselines3 --------------------------------------------------------------------------------


def permutations(seed, rows, count):
    """Draw the orders that the same seed gives in Stable-Baselines3."""
    np.random.seed(seed)
    return [np.random.permutation(rows) for _ in range(count)]


def sb3_ppo(case, policy, value, log_std, seed, epochs, batch):
    """Return the weights after each step of PPO.train(), and what it logs."""
    rows = len(case["action"])
    observations = np.array(case["observation"])
    discrete = log_std is None
    outputs = len(policy[-1])
    action_space = gymnasium.spaces.Discrete(outputs) if discrete else box(outputs, 100)
    hidden = {"pi": [len(w) for w in policy[:-1]], "vf": [len(w) for w in value[:-1]]}
    model = sb3.PPO(
        "MlpPolicy",
        Nothing(box(observations.shape[1]), action_space),
        n_steps=rows,
        n_epochs=epochs,
        batch_size=batch,
        learning_rate=case["learning_rate"],
        clip_range=case["clip"],
        ent_coef=case["entropy"],
        vf_coef=case["value_weight"],
        max_grad_norm=case["max_grad_norm"],
        device="cpu",
        policy_kwargs={"net_arch": hidden, "features_extractor_class": InDoubles},
    )
    model.set_logger(configure(None, []))
    own = model.policy.double()
    parts = (
        [own.mlp_extractor.policy_net, own.action_net],
        [own.mlp_extractor.value_net, own.value_net],
    )
    into_torch(policy, *parts[0])
    into_torch(value, *parts[1])
    if not discrete:
        own.log_std.data = torch.from_numpy(log_std.copy())
    buffer = model.rollout_buffer
    buffer.observations[:, 0] = observations
    buffer.actions[:, 0] = np.array(case["action"]).reshape(rows, -1)
    for name, column in {
        "log_probs": "log_prob",
        "advantages": "advantage",
        "returns": "return",
        "values": "return",
    }.items():
        setattr(buffer, name, np.array(case[column]).reshape(rows, 1))
    buffer.full = True
    after = []

    def keep(*_):
        extra = () if discrete else own.log_std.detach().numpy()
        after.append(vector(from_torch(*parts[0]), extra) + vector(from_torch(*parts[1])))

    own.optimizer.register_step_post_hook(keep)
    np.random.seed(seed)
    model.train()
    logged = {name: float(model.logger.name_to_value[f"train/{name}"]) for name in LOGGED}
    return after, logged


def sb3_dqn(case, values):
    """Return the weights after each call of DQN.train()."""
    rows = len(case["action"])
    observations = np.array(case["observation"])
    model = sb3.DQN(
        "MlpPolicy",
        Nothing(box(observations.shape[1]), gymnasium.spaces.Discrete(len(values[-1]))),
        buffer_size=rows,
        learning_rate=case["learning_rate"],
        gamma=case["discount"],
        max_grad_norm=case["max_grad_norm"],
        tau=case["tau"],
        target_update_interval=case["target_every"],
        device="cpu",
        policy_kwargs={
            "net_arch": [len(w) for w in values[:-1]],
            "features_extractor_class": InDoubles,
        },
    )
    model.set_logger(configure(None, []))
    model.policy.double()
    into_torch(values, model.q_net)
    into_torch(values, model.q_net_target)
    buffer = model.replay_buffer
    buffer.observations[:, 0] = observations
    buffer.next_observations[:, 0] = np.array(case["next_observation"])
    buffer.actions[:, 0, 0] = case["action"]
    buffer.rewards[:, 0] = case["reward"]
    buffer.dones[:, 0] = case["terminated"]
    orders = iter(case["order"])
    buffer.sample = lambda batch_size, env: buffer._get_samples(np.array(next(orders)), env)
    after = []
    for _ in range(UPDATES):
        model.train(1)
        model._on_step()
        after.append(vector(from_torch(model.q_net)))
    return after


# The cases ----------------------------------------------------------------------------------------


def ppo_case(discrete, seed):
    """Draw the data of an iteration of PPO, and update with it."""
    rows, batch, epochs = 40, 20, 5
    sizes = [4, 5, 3, 2]
    policy, value = draw_weights(sizes), draw_weights([4, 4, 3, 1])
    log_std = None if discrete else np.array([-0.3, 0.2])
    observations = coarse(rng.normal(size=(rows, 4)))
    _, out = forward([w + rng.normal(0, 0.05, w.shape) for w in policy], observations, "tanh")
    if discrete:
        action = rng.integers(0, 2, rows)
        log_prob = (out - np.log(np.exp(out).sum(1, keepdims=True)))[np.arange(rows), action]
    else:
        action = coarse(out + np.exp(log_std) * rng.normal(size=out.shape))
        z = (action - out) / np.exp(log_std)
        log_prob = (-(z**2) / 2 - log_std - np.log(2 * np.pi) / 2).sum(1)
    case = {
        "sizes": sizes,
        "value_sizes": [4, 4, 3, 1],
        "activation": "tanh",
        "learning_rate": 0.02,
        "clip": 0.2,
        "entropy": 0.01,
        "value_weight": 0.5,
        "max_grad_norm": 1.5,
        "observation": observations.tolist(),
        "action": action.tolist(),
        "log_prob": coarse(log_prob).tolist(),
        "advantage": coarse(rng.normal(2, 3, rows)).tolist(),
        "return": coarse(rng.normal(1, 2, rows)).tolist(),
        "order": [
            part.tolist()
            for order in permutations(seed, rows, epochs)
            for part in np.split(order, rows // batch)
        ],
        "start": vector(policy, () if discrete else log_std) + vector(value),
    }
    case["numpy"] = numpy_ppo(case, policy, value, log_std)
    case["sb3"], case["log"] = sb3_ppo(case, policy, value, log_std, seed, epochs, batch)
    return case


def drawn_by_r(seed, rows, batch):
    """Ask R for the rows that agent_dqn() draws after set.seed()."""
    script = f"set.seed({seed}); cat(sample.int({rows}, {batch * UPDATES}, replace = TRUE) - 1L)"
    said = subprocess.run(["Rscript", "-e", script], capture_output=True, check=True, text=True)
    return np.array(said.stdout.split(), dtype=int).reshape(UPDATES, batch).tolist()


def dqn_case(seed, *, tau, target_every, max_grad_norm, double=False):
    """Draw the memory of a DQN agent, and update with it."""
    rows, batch = 40, 16
    sizes = [4, 4, 4, 3]
    values = draw_weights(sizes)
    case = {
        "sizes": sizes,
        "activation": "ReLU",
        "learning_rate": 0.1 if double else 0.03,
        "discount": 0.875,
        "double": double,
        "tau": tau,
        "target_every": target_every,
        "max_grad_norm": max_grad_norm,
        "observation": coarse(rng.normal(size=(rows, 4))).tolist(),
        "action": rng.integers(0, 3, rows).tolist(),
        "reward": coarse(rng.normal(0, 1, rows)).tolist(),
        "terminated": (rng.random(rows) < 0.2).astype(int).tolist(),
        "next_observation": coarse(rng.normal(size=(rows, 4))).tolist(),
        "order": drawn_by_r(seed, rows, batch),
        "start": vector(values),
    }
    case["numpy"] = numpy_dqn(case, values)
    if not double:
        case["sb3"] = sb3_dqn(case, values)
    return case


cases = {
    "ppo": {"discrete": ppo_case(True, 1), "gaussian": ppo_case(False, 2)},
    "dqn": {
        "hard": dqn_case(3, tau=1.0, target_every=4, max_grad_norm=0.35),
        "soft": dqn_case(4, tau=0.1, target_every=1, max_grad_norm=1.7),
        "double": dqn_case(5, tau=1.0, target_every=5, max_grad_norm=0.45, double=True),
    },
}
for agent, of_agent in cases.items():
    for name, case in of_agent.items():
        ours = np.array(case["numpy"])
        if "sb3" in case:
            apart = np.abs(ours - np.array(case["sb3"])).max()
            print(f"{agent}, {name}: NumPy and Stable-Baselines3 are {apart:.1e} apart")
            assert apart < 1e-12
            case["sb3"] = np.round(case["sb3"], 12).tolist()
        case["numpy"] = np.round(ours, 12).tolist()
cases["made_with"] = {
    "stable_baselines3": sb3.__version__,
    "torch": torch.__version__,
    "numpy": np.__version__,
    "python": sys.version.split()[0],
}
with open("tests/testthat/gradient_updates.json", "w") as file:
    json.dump(cases, file, separators=(",", ":"))
    file.write("\n")
