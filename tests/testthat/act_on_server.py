"""Act like the server's policies: python act_on_server.py FOLDER

Each file IN.safetensors in it is a policy in the format of a request for rollouts, with the tensor
"observation" and the metadata "space" (the action space). IN.acted gets each action as float64:
first chosen one by one, and then all of them again, chosen in groups.
"""

import json
import sys
from pathlib import Path

import numpy as np
from gymnasium.spaces import Box, Discrete

from gym_server.policies import read_policy
from gym_server.protocol import safetensors

GROUP = 256


def act(given):
    file = safetensors.read(given.read_bytes())
    arrays = {name: tensor.array() for name, tensor in file.tensors.items()}
    observations = arrays.pop("observation").astype(np.float32)
    space = json.loads(file.metadata["space"])
    if "n" in space:
        space = Discrete(space["n"], start=space["start"])
    else:
        space = Box(np.float32(space["low"]), np.float32(space["high"]))
    policy = read_policy(
        json.loads(file.metadata["policy"]),
        {name.removeprefix("policy/"): array for name, array in arrays.items()},
        Box(-np.inf, np.inf, observations.shape[1:], np.float32),
        space,
    )
    actor = policy.actor(0)
    actor.begin(0)
    single = np.array([actor.act(observation) for observation in observations])
    group = policy.actor(np.zeros(GROUP, int))
    group.begin(0)
    blocks = np.split(observations, range(GROUP, len(observations), GROUP))
    together = np.concatenate([group.act(block) for block in blocks])
    np.concatenate([single.ravel(), together.ravel()]).astype(np.float64).tofile(
        given.with_suffix(".acted")
    )


if __name__ == "__main__":
    for file in Path(sys.argv[1]).glob("*.safetensors"):
        act(file)
