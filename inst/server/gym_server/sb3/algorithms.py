"""The algorithms by their names, and their arguments as JSON has them."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import sb3_contrib
import stable_baselines3
import torch
from gymnasium.spaces import Box, Space
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import NormalActionNoise, OrnsteinUhlenbeckActionNoise
from stable_baselines3.common.sb2_compat.rmsprop_tf_like import RMSpropTFLike

from gym_server.sb3.failures import JobError

NAMES = (
    *("PPO", "A2C", "DQN", "SAC", "TD3", "DDPG"),
    *("TQC", "TRPO", "QRDQN", "CrossQ", "RecurrentPPO", "MaskablePPO"),
)

# As in rl-baselines3-zoo, besides PyTorch's.
_OPTIMIZERS = {"RMSpropTFLike": RMSpropTFLike}

# They are arguments of learn_sb3() itself, or of Python's objects.
_NOT_GIVEN = {"self", "policy", "env", "seed", "device", "verbose", "tensorboard_log"}
_NOT_GIVEN |= {"_init_setup_model", "action_noise", "replay_buffer_class", "rollout_buffer_class"}


def algorithm(name: str) -> type[BaseAlgorithm]:
    """Return an algorithm's class."""
    if name not in NAMES:
        raise JobError(f'There is no algorithm "{name}".', argument="algorithm", known=NAMES)
    found: type[BaseAlgorithm] = getattr(stable_baselines3, name, None) or getattr(
        sb3_contrib, name
    )
    return found


def arguments_of(make: type[BaseAlgorithm], given: dict[str, Any], space: Space) -> dict[str, Any]:
    """Return the arguments for Python.

    Args:
        make: the algorithm's class.
        given: the arguments as JSON has them.
        space: the action space, for the noise.
    """
    names = [name for name in inspect.signature(make).parameters if name not in _NOT_GIVEN]
    has_noise = "action_noise" in inspect.signature(make).parameters
    known = names + (["noise_type", "noise_std"] if has_noise else [])
    for name in given:
        if name not in known:
            raise JobError(f"{make.__name__} has no argument `{name}`.", argument=name, known=known)
    values = {name: _plain(value) for name, value in given.items()}
    noise = {name: values.pop(name, None) for name in ("noise_type", "noise_std")}
    if noise["noise_type"] is not None:
        values["action_noise"] = _noise(space, **noise)
    for name in ("learning_rate", "clip_range", "clip_range_vf"):
        if isinstance(values.get(name), str):
            values[name] = _linear(values[name], name)
    if isinstance(values.get("train_freq"), list):
        values["train_freq"] = tuple(values["train_freq"])
    if "policy_kwargs" in values:
        values["policy_kwargs"] = _policy_arguments(dict(values["policy_kwargs"]))
    return values


def _plain(value: Any) -> Any:
    """Return whole numbers as ``int``: R has none that it would tell from others."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return value


def _linear(text: str, name: str) -> Callable[[float], float]:
    found = re.fullmatch(r"lin_([0-9.]+(?:e-?[0-9]+)?)", text)
    if found is None:
        raise JobError(
            f'`{name}` must be a number, or such as "lin_3e-4", not "{text}".', argument=name
        )
    return functools.partial(_times, float(found[1]))


def _times(start: float, remaining: float) -> float:
    return start * remaining


def _noise(space: Space, noise_type: str, noise_std: float | None) -> Any:
    kinds = {"normal": NormalActionNoise, "ornstein-uhlenbeck": OrnsteinUhlenbeckActionNoise}
    if noise_type not in kinds:
        raise JobError(
            f'There is no noise "{noise_type}".', argument="noise_type", known=list(kinds)
        )
    if not isinstance(space, Box):
        raise JobError("Noise needs actions that are a Box.", argument="noise_type")
    deviation = 0.1 if noise_std is None else noise_std
    return kinds[noise_type](np.zeros(space.shape), np.full(space.shape, deviation))


def _policy_arguments(values: dict[str, Any]) -> dict[str, Any]:
    for name, home in (("activation_fn", torch.nn), ("optimizer_class", torch.optim)):
        wanted = values.get(name)
        if isinstance(wanted, str):
            values[name] = _OPTIMIZERS.get(wanted) or getattr(home, wanted, None)
            if values[name] is None:
                raise JobError(f'{home.__name__} has no "{wanted}".', argument="policy_kwargs")
    # R has no vector of one number that it would tell from the number.
    layers = values.get("net_arch")
    if isinstance(layers, int):
        values["net_arch"] = [layers]
    elif isinstance(layers, dict):
        values["net_arch"] = {
            key: [own] if isinstance(own, int) else own for key, own in layers.items()
        }
    return values
