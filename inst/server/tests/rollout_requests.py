"""Requests for rollouts, and expected results."""

import json

import gymnasium
import numpy as np

from gym_server.protocol import safetensors
from gym_server.protocol.safetensors import TENSORS, Tensor

RANDOM = {"kind": "random"}


def request_body(seeds, env_id="FrozenLake-v1", policy=RANDOM, tensors=(), **fields):
    """Return the body of a request."""
    fields = {"env_id": env_id, "policy": policy, **fields}
    arrays = {"seed": np.array(seeds, np.int64), **dict(tensors)}
    return safetensors.write(
        {name: Tensor.of(np.asarray(array)) for name, array in arrays.items()},
        {name: json.dumps(value) for name, value in fields.items()},
    )


def read_answer(data):
    """Return the arrays and the metadata of a response."""
    file = safetensors.read(data)
    return {name: tensor.array() for name, tensor in file.tensors.items()}, file.metadata


def roll_out(client, seeds, accept=TENSORS, **fields):
    """Request episodes; return the arrays and the metadata of the response."""
    answer = client.post(
        "/v1/rollouts/",
        data=request_body(seeds, **fields),
        content_type=TENSORS,
        headers={"Accept": accept},
    )
    assert answer.status_code == 200, answer.json
    return read_answer(answer.data)


def refused(client, seeds, **fields):
    """Request episodes that cannot be played; return the error."""
    answer = client.post("/v1/rollouts/", data=request_body(seeds, **fields), content_type=TENSORS)
    assert answer.status_code >= 400
    return answer.json


def played_by_hand(env_id, seeds, max_steps=None, **kwargs):
    """Play a random policy in an environment that is made again for each episode."""
    episodes = []
    for seed in seeds:
        env = gymnasium.make(env_id, **kwargs)
        generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, 1])))
        env.action_space._np_random = generator
        steps = []
        observation, _ = env.reset(seed=seed)
        over = False
        while not over and len(steps) != max_steps:
            action = env.action_space.sample()
            after, reward, terminated, truncated, _ = env.step(action)
            steps.append((observation, action, float(reward), terminated, truncated, after))
            observation, over = after, terminated or truncated
        env.close()
        episodes.append(steps)
    return episodes
