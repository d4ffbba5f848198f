"""Make policies for tests, and compute their actions by hand."""

import itertools
import math

import numpy as np
from gymnasium.spaces import Box, Discrete
from numpy.random import PCG64, Generator, SeedSequence

from gym_server.policies import read_policy

TWO = Discrete(2)


def box(n, bound=10.0, dtype=np.float32):
    return Box(-bound, bound, (n,), dtype)


def count_weights(sizes, bias=False):
    return sum(n * (taken + bias) for taken, n in itertools.pairwise(sizes))


def network(
    sizes, activation, observed, acted, weights=None, bias=False, candidates=1, tensors=(), **fields
):
    if weights is None:
        shape = (candidates, count_weights(sizes, bias))
        weights = np.random.default_rng(7).normal(size=shape)
    document = {"kind": "network", "sizes": sizes, "activation": activation, "bias": bias}
    return read_policy(
        {**document, **fields}, {"weights": np.asarray(weights), **dict(tensors)}, observed, acted
    )


def table(q, observed, acted, **fields):
    return read_policy({"kind": "table", **fields}, {"q": np.asarray(q, float)}, observed, acted)


def begun(policy, candidate=0, seed=5):
    actor = policy.actor(candidate)
    actor.begin(seed)
    return actor


def episode_generator(seed):
    return Generator(PCG64(SeedSequence([seed, 1])))


def plogis(x):
    return 1 / (1 + math.exp(-x)) if x > -700 else 0.0


# R's package sigmoid, and R's tanh() and plogis().
FORMULAS = {
    "tanh": math.tanh,
    "logistic": plogis,
    "identity": lambda x: x,
    "Gompertz": lambda x: math.exp(-math.exp(-x)) if x > -700 else 0.0,
    "ReLU": lambda x: x if x >= 0 else 0.0,
    "leakyReLU": lambda x: x if x >= 0 else 0.01 * x,
}


def outputs_of(sizes, activation, weights, inputs, bias=False):
    """Return the outputs of a network, number by number."""
    weights = list(weights)
    signal = [float(x) for x in inputs]
    for neurons, name in zip(sizes[1:], activation, strict=True):
        signal = [*signal, 1.0] if bias else signal
        # Column by column: the weights of all neurons for the first input come first.
        columns = [[weights.pop(0) for _ in range(neurons)] for _ in signal]
        signal = [
            FORMULAS[name](math.fsum(c[n] * x for c, x in zip(columns, signal, strict=True)))
            for n in range(neurons)
        ]
    return signal


def box_action(outputs, name, low, high):
    """Return the result of R's box_action() for one row, before it is cast."""
    action = []
    for x, lowest, highest in zip(outputs, low, high, strict=True):
        if name in ("tanh", "logistic", "Gompertz"):
            share = (x + 1) / 2 if name == "tanh" else x
            x = lowest * (1 - share) + highest * share
        action.append(min(max(x, lowest), highest))
    return action
