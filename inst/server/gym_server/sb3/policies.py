"""Policies as files: as a network of R, or else to be played by Stable-Baselines3 again.

Neither has a pickle. What R cannot calculate, such as convolutions, is kept as the weights of
PyTorch and as the arguments that make the policy, in plain JSON.
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.spaces import Box, Dict, Discrete
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from gym_server.protocol import safetensors
from gym_server.sb3 import algorithms, files
from gym_server.sb3.failures import JobError
from gym_server.sb3.networks import Network, NotANetworkError, network_of

# The arguments of an algorithm that change what its policy is.
_OF_POLICY = ("policy_kwargs", "use_sde")

_WEIGHT = "weight "


def write(folder: Path, model: BaseAlgorithm, job: dict[str, Any]) -> None:
    """Write a model's policy for R."""
    moments = moments_of(model.get_vec_normalize_env())
    try:
        write_network(folder, network(model), moments)
    except NotANetworkError:
        states = {name: value.cpu().numpy() for name, value in model.policy.state_dict().items()}
        write_states(folder, states, job["algorithm"], job["policy"], job["arguments"], moments)


def network(model: BaseAlgorithm) -> Network:
    """Return the network that acts.

    Raises:
        NotANetworkError: R has no such network.
    """
    if type(model).__name__ == "MaskablePPO":
        raise NotANetworkError("it needs the mask of valid actions")
    if isinstance(model.observation_space, Dict):
        raise NotANetworkError("its observations have several parts")
    states = model.policy.state_dict()
    activation = getattr(model.policy, "activation_fn", None)
    space = model.action_space
    if not isinstance(space, (Box, Discrete)):
        raise NotANetworkError("its actions are neither Discrete nor a Box")
    return network_of(
        {name: value.detach().cpu().numpy() for name, value in states.items()},
        int(space.n) if isinstance(space, Discrete) else None,
        activation.__name__ if activation is not None else None,
        bool(getattr(model.policy, "squash_output", False)),
        float(getattr(getattr(model, "actor", None), "clip_mean", 2.0)),
    )


def moments_of(env: VecNormalize | None) -> dict[str, Any] | None:
    """Return how observations are normalized, None if they are not."""
    if env is None or not env.norm_obs:
        return None
    found: Any = env.obs_rms
    moments = {"mean": found.mean, "variance": found.var + env.epsilon, "count": found.count}
    return {**moments, "clip_obs": env.clip_obs}


def write_network(folder: Path, network: Network, moments: dict[str, Any] | None) -> None:
    """Write a network as R's ``policy_network()`` takes it."""
    tensors = {f"layer {i}": layer for i, layer in enumerate(network.layers)}
    about: dict[str, Any] = {"output": network.output, "activation": network.activation}
    if network.log_std is not None:
        tensors["log_std"] = network.log_std
    _write(folder, tensors, about, moments)


def write_states(
    folder: Path,
    states: Mapping[str, np.ndarray],
    algorithm: str,
    policy: str,
    arguments: dict[str, Any],
    moments: dict[str, Any] | None,
) -> None:
    """Write the weights of a policy that Stable-Baselines3 plays, and what makes it."""
    # An actor and a critic that share layers have each of them under several names.
    kept: dict[str, np.ndarray] = {}
    same: dict[str, str] = {}
    for name, value in states.items():
        twin = next((other for other in kept if np.array_equal(kept[other], value)), None)
        if twin is None:
            kept[name] = value
        else:
            same[name] = twin
    tensors = {_WEIGHT + name: value for name, value in kept.items()}
    own = {name: arguments[name] for name in _OF_POLICY if name in arguments}
    about = {"algorithm": algorithm, "policy": policy, "arguments": own, "same": same}
    _write(folder, tensors, about, moments)


def _write(
    folder: Path,
    tensors: dict[str, Any],
    about: dict[str, Any],
    moments: dict[str, Any] | None,
) -> None:
    if moments is not None:
        tensors.update({name: moments[name] for name in ("mean", "variance")})
        about.update(clip_obs=moments["clip_obs"], count=moments["count"])
    files.write_tensors(folder / "policy.safetensors", tensors, about)


class Player:
    """Plays the episodes of one environment; an actor for ``play_episode()``."""

    # Predictions are within the bounds of a Box.
    clip = None

    def __init__(self, model: BaseAlgorithm, env: gymnasium.Env, normalize: Any = None) -> None:
        """Keep what acts.

        Args:
            model: the model.
            env: the environment, which has the masks of a MaskablePPO.
            normalize: a function that normalizes observations, or None.
        """
        self.model, self.env, self.normalize = model, env, normalize
        self.masked = type(model).__name__ == "MaskablePPO"

    def begin(self, seed: int) -> None:
        """Start an episode."""
        self._state: Any = None

    def act(self, observation: Any) -> Any:
        """Return the most likely action; a recurrent policy remembers the earlier ones."""
        if self.normalize is not None:
            observation = self.normalize(observation)
        masks: Any = {}
        if self.masked:
            masks["action_masks"] = self.env.get_wrapper_attr("action_masks")()
        action, self._state = self.model.predict(
            observation, self._state, deterministic=True, **masks
        )
        # Tables need a number, not an array without dimensions.
        return action[()]


def read(path: Path, env: gymnasium.Env) -> Player:
    """Return the policy of a file of ``write_states()``, for an environment.

    Raises:
        JobError: it does not fit the environment.
    """
    tensors, metadata = safetensors.read(path.read_bytes())
    about = json.loads(metadata["about"])
    make: Any = algorithms.algorithm(about["algorithm"])
    arguments = algorithms.arguments_of(make, about["arguments"], env.action_space)
    if "buffer_size" in inspect.signature(make).parameters:
        # It does not learn.
        arguments["buffer_size"] = 1
    states = {
        name.removeprefix(_WEIGHT): torch.as_tensor(tensor.array())
        for name, tensor in tensors.items()
        if name.startswith(_WEIGHT)
    }
    states.update({name: states[twin] for name, twin in about["same"].items()})
    # More threads would only wait for each other: it is asked for one action at a time.
    torch.set_num_threads(1)
    try:
        model = make(about["policy"], DummyVecEnv([lambda: env]), device="cpu", **arguments)
        model.policy.load_state_dict(states)
    except (AssertionError, RuntimeError, TypeError, ValueError) as failure:
        text = " ".join(str(failure).split())[:200]
        raise JobError(
            f"The {about['policy']} does not fit {env.spec and env.spec.id}: {text}",
            "It plays in environments with the observations and actions of its training.",
            argument="policy",
        ) from failure
    return Player(model, env, _normalizer(tensors, about))


def _normalizer(tensors: Mapping[str, safetensors.Tensor], about: dict[str, Any]) -> Any:
    if "mean" not in tensors:
        return None
    mean, deviation = tensors["mean"].array(), np.sqrt(tensors["variance"].array())
    clip = about["clip_obs"]
    return lambda observation: np.clip((observation - mean) / deviation, -clip, clip).astype(
        np.float32
    )
