"""Play a vector environment over HTTP and in this process, and compare. For tests."""

import json

import faulty_envs
import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Dict, Discrete, Text, Tuple
from gymnasium.vector.utils import concatenate, create_empty_array, iterate

from gym_server import spaces
from gym_server.json_values import plain
from gym_server.protocol import safetensors
from gym_server.protocol.safetensors import TENSORS
from gym_server.spaces.stacking import stack

MODES = ["NextStep", "SameStep", "Disabled"]
# For slow tests: `make test` runs only the first mode.
MODES_SLOWLY = [MODES[0], *(pytest.param(mode, marks=pytest.mark.slow) for mode in MODES[1:])]
ACCEPT = {"Accept": TENSORS}
KINDS = [kind for kind in faulty_envs.SPACES if kind != "nothing"]
IN_TENSORS = [kind for kind in KINDS if spaces.travels_as_tensors(faulty_envs.SPACES[kind])]


def in_process(env_id, num_envs, autoreset_mode="NextStep", **kwargs):
    """Return Gymnasium's vector environment, whose infos the responses must equal."""
    return gymnasium.make_vec(
        env_id,
        num_envs=num_envs,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": autoreset_mode},
        disable_env_checker=True,
        **kwargs,
    )


def actions_of(env, seed):
    """Return actions for the sub-environments, one by one and as a batch."""
    env.single_action_space.seed(seed)
    actions = [env.single_action_space.sample() for _ in range(env.num_envs)]
    return actions, stack(env.single_action_space, actions)


def members(env, batch):
    """Return the members of a batch as JSON values."""
    return [
        plain(spaces.encode(env.single_observation_space, member))
        for member in iterate(env.observation_space, batch)
    ]


def apart(space, batch):
    """Return the members of a batch that was received as JSON."""
    match space:
        case Dict():
            parts = {key: apart(part, batch[str(key)]) for key, part in space.spaces.items()}
            return [
                dict(zip(map(str, parts), sub_env, strict=True))
                for sub_env in zip(*parts.values(), strict=True)
            ]
        case Tuple():
            parts = [apart(part, items) for part, items in zip(space.spaces, batch, strict=True)]
            return [list(sub_env) for sub_env in zip(*parts, strict=True)]
        case _:
            return batch


def split_final(env, info):
    """Split an info into the info without last observations, these as JSON values, and their
    sub-environments."""
    info = dict(info)
    final, which = info.pop("final_obs", None), info.pop("_final_obs", None)
    if final is None:
        return plain(info), None, None
    sub_envs = np.flatnonzero(which).tolist()
    space = env.single_observation_space
    batch = create_empty_array(space, n=len(sub_envs))
    batch = concatenate(space, [final[sub_env] for sub_env in sub_envs], batch)
    batched = gymnasium.vector.utils.batch_space(space, len(sub_envs))
    encoded = [plain(spaces.encode(space, member)) for member in iterate(batched, batch)]
    return plain(info), encoded, sub_envs


def check_step(env, answer, expected):
    """Check that a step's JSON response equals Gymnasium's result."""
    observation, reward, terminated, truncated, info = expected
    info, final, sub_envs = split_final(env, info)
    space = env.single_observation_space
    assert apart(space, answer["observation"]) == members(env, observation)
    assert answer["reward"] == reward.tolist()
    assert answer["terminated"] == terminated.tolist()
    assert answer["truncated"] == truncated.tolist()
    assert answer["done"] == (terminated | truncated).tolist()
    assert answer["info"] == info
    assert ("final_obs" in answer, answer.get("final_sub_envs")) == (final is not None, sub_envs)
    if final is not None:
        assert apart(space, answer["final_obs"]) == final


def check_tensors(space, name, file, batch):
    """Check that the tensors of a batch equal it, byte for byte."""
    texts = json.loads(file.metadata.get("texts", "{}"))
    match space:
        case Dict():
            for key, part in space.spaces.items():
                pointer = key.replace("~", "~0").replace("/", "~1")
                check_tensors(part, f"{name}/{pointer}", file, batch[key])
        case Tuple():
            for index, part in enumerate(space.spaces):
                check_tensors(part, f"{name}/{index}", file, batch[index])
        case Text():
            assert [texts[f"{name}/{sub_env}"] for sub_env in range(len(batch))] == list(batch)
        case _:
            batch = np.asarray(batch, np.int64 if isinstance(space, Discrete) else None)
            array = file.tensors[name].array()
            assert (array.dtype, array.shape) == (batch.dtype, batch.shape)
            assert array.tobytes() == batch.tobytes()


def read_tensors(answer):
    """Return the file in a response."""
    assert (answer.status_code, answer.content_type) == (200, TENSORS), answer.data
    return safetensors.read(answer.data)


def twin(space="Box", num_envs=3, autoreset_mode="NextStep", longest=4):
    return in_process("Uneven-v0", num_envs, autoreset_mode, space=space, longest=longest)


def post(client, url, route, headers=None, **body):
    answer = client.post(f"{url}/{route}/", json=body, headers=headers)
    assert answer.status_code == 200, answer.json
    return answer.json if headers is None else read_tensors(answer)


def refusal(client, url, route, **body):
    answer = client.post(f"{url}/{route}/", json=body)
    assert answer.status_code == 400, answer.json
    return answer.json["code"], answer.json["message"]


def reset_those_that_ended(client, url, env, ended):
    """Reset them in both, as the mode without autoreset requires."""
    expected, info = env.reset(options={"reset_mask": np.array(ended)})
    answer = post(client, url, "reset", reset_mask=ended)
    space = env.single_observation_space
    assert apart(space, answer["observation"]) == members(env, expected)
    assert answer["info"] == plain(info)


def action_file(env, batch, **metadata):
    parts = spaces.tensor_writer(env.single_action_space, "action", is_batch=True)(batch)
    if parts.texts:
        metadata["texts"] = parts.texts
    metadata = {name: json.dumps(value) for name, value in metadata.items()}
    return safetensors.write(parts.tensors, metadata)


def check_that_no_sub_env_moved(client, url, kind, seed, mode="NextStep"):
    """Check that the next step equals the first one after a reset."""
    env = twin(kind, autoreset_mode=mode)
    env.reset(seed=seed)
    actions, batch = actions_of(env, 0)
    encoded = [plain(spaces.encode(env.single_action_space, action)) for action in actions]
    check_step(env, post(client, url, "step", action=encoded), env.step(batch))
