"""A policy's network as matrices, from the names of its weights in PyTorch.

The names are those of Stable-Baselines3's policies, which a zip file of a model has, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Weights = Mapping[str, np.ndarray]

# By the names of PyTorch.
ACTIVATIONS = {
    "Tanh": "tanh",
    "ReLU": "ReLU",
    "LeakyReLU": "leakyReLU",
    "Sigmoid": "logistic",
    "Identity": "identity",
}


class NotANetworkError(Exception):
    """The reason why a policy is not a network of full layers."""


@dataclass
class Network:
    """A network as R's ``policy_network()`` takes it.

    Attributes:
        output: how the outputs determine an action.
        layers: a matrix for each layer, the bias in the last column.
        activation: R's name of the activation after each layer.
        log_std: the logarithms of the standard deviations of a Gaussian.
    """

    output: str
    layers: list[np.ndarray] = field(default_factory=list)
    activation: list[str] = field(default_factory=list)
    log_std: np.ndarray | None = None

    def add(self, weight: np.ndarray, bias: np.ndarray, activation: str) -> None:
        """Add a layer."""
        self.layers.append(np.column_stack([weight, bias]))
        self.activation.append(activation)


def network_of(
    weights: Weights,
    actions: int | None,
    activation: str | None = None,
    squashes: bool = False,
    clip_mean: float = 2.0,
    epsilon: float = 0.001,
) -> Network:
    """Return the network that acts.

    Args:
        weights: the policy's weights by PyTorch's names.
        actions: the number of discrete actions; None for a Box.
        activation: PyTorch's name of the hidden layers' activation; None for the algorithm's
            default.
        squashes: whether an actor-critic's Gaussian is squashed by tanh.
        clip_mean: where an actor with state-dependent exploration clips its means.
        epsilon: of batch renormalization (CrossQ).

    Raises:
        NotANetworkError: it has other layers, or other actions.
    """
    if any("cnn" in name or "lstm" in name for name in weights):
        raise NotANetworkError("it has convolutional or recurrent layers")
    if any("extractors" in name for name in weights):
        raise NotANetworkError("its observations have several parts")
    weights = {name: np.asarray(value, np.float64) for name, value in weights.items()}
    if "action_net.weight" in weights:
        hidden = _hidden(activation or "Tanh")
        return _actor_critic(weights, actions, hidden, squashes)
    hidden = _hidden(activation or "ReLU")
    if "actor.latent_pi.0.weight" in weights or "actor.latent_pi.0.scale" in weights:
        return _squashed(weights, hidden, clip_mean, epsilon)
    if "actor.mu.0.weight" in weights:
        return _stack(Network("greedy"), _part(weights, "actor.mu."), hidden, "tanh")
    if "q_net.q_net.0.weight" in weights:
        return _stack(Network("greedy"), _part(weights, "q_net.q_net."), hidden, "identity")
    if "quantile_net.quantile_net.0.weight" in weights:
        network = _stack(
            Network("greedy"), _part(weights, "quantile_net.quantile_net."), hidden, "identity"
        )
        # An action's value is the mean of its quantiles, and the mean of linear functions is one.
        last = network.layers[-1]
        network.layers[-1] = last.reshape(-1, actions or 1, last.shape[1]).mean(axis=0)
        return network
    raise NotANetworkError("its layers are not those of an algorithm that is known")


def _hidden(activation: str) -> str:
    if activation not in ACTIVATIONS:
        raise NotANetworkError(f"the activation {activation} is not one of R's networks")
    return ACTIVATIONS[activation]


def _part(weights: Weights, prefix: str) -> dict[str, np.ndarray]:
    return {
        name[len(prefix) :]: value for name, value in weights.items() if name.startswith(prefix)
    }


def _stack(
    network: Network, part: Weights, hidden: str, last: str, epsilon: float = 0.0
) -> Network:
    """Add the layers of a ``Sequential``; a normalization becomes part of the next layer."""
    numbers = sorted({int(name.partition(".")[0]) for name in part})
    scale: Any = 1.0
    shift: Any = 0.0
    for number in numbers:
        own = _part(part, f"{number}.")
        if "weight" in own:
            weight = own["weight"]
            moved = weight @ np.broadcast_to(shift, (weight.shape[1],))
            network.add(weight * scale, own["bias"] + moved, hidden)
            scale, shift = 1.0, 0.0
        elif "ra_mean" in own:
            scale = own["scale"] / np.sqrt(own["ra_var"] + epsilon)
            shift = own["bias"] - own["ra_mean"] * scale
        else:
            raise NotANetworkError("it has a layer that is neither full nor a normalization")
    network.activation[-1] = last
    return network


# The number of the outputs' layer, after all hidden ones.
_LAST = 1000


def _with_outputs(weights: Weights, hidden: str, outputs: str) -> dict[str, np.ndarray]:
    last = {f"{_LAST}.{name}": value for name, value in _part(weights, outputs).items()}
    return {**_part(weights, hidden), **last}


def _actor_critic(weights: Weights, actions: int | None, hidden: str, squashes: bool) -> Network:
    deviation = weights.get("log_std")
    network = Network("softmax" if actions is not None else "gaussian", log_std=deviation)
    # With state-dependent exploration the deviations depend on the observation.
    if squashes or (deviation is not None and deviation.ndim > 1):
        network.output, network.log_std = "greedy", None
    # Until its version 1.7 Stable-Baselines3 had layers that policy and values share.
    if shared := _part(weights, "mlp_extractor.shared_net."):
        _stack(network, shared, hidden, hidden)
    part = _with_outputs(weights, "mlp_extractor.policy_net.", "action_net.")
    return _stack(network, part, hidden, "tanh" if squashes else "identity")


def _squashed(weights: Weights, hidden: str, clip_mean: float, epsilon: float) -> Network:
    clips = "actor.mu.0.weight" in weights
    part = _with_outputs(weights, "actor.latent_pi.", "actor.mu.0." if clips else "actor.mu.")
    network = _stack(Network("greedy"), part, hidden, "tanh", epsilon)
    if clips:
        # A number clipped at -c and c is ReLU(x + c) - ReLU(x - c) - c, which are two layers.
        means = network.layers.pop()
        network.activation.pop()
        above, below = means.copy(), means.copy()
        above[:, -1] += clip_mean
        below[:, -1] -= clip_mean
        both = np.concatenate([above, below])
        network.add(both[:, :-1], both[:, -1], "ReLU")
        one = np.eye(len(means))
        network.add(np.concatenate([one, -one], axis=1), np.full(len(means), -clip_mean), "tanh")
    return network
