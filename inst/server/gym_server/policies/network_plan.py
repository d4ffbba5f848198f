"""What the networks of a policy have in common."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from math import prod

import numpy as np
from gymnasium.spaces import Box, Discrete

from gym_server.policies.activation import HAVE_RANGE


@dataclass(frozen=True)
class NetworkPlan:
    """Everything about a network except its weights.

    Attributes:
        observation_space: the space of the inputs.
        action_space: the space of the outputs.
        sizes: the numbers of inputs, neurons of each hidden layer, and outputs.
        activation: the activation of each layer after the inputs.
        bias: whether each neuron has a bias, the last column of its layer's matrix.
        output: "greedy", "softmax", "gaussian" or "epsilon-greedy".
        epsilon: how often "epsilon-greedy" explores; None if not given.
        mean, scale: float64[inputs], which normalize inputs by ``(x - mean) * scale``; None for no
            normalization.
        clip_obs: where to clip normalized inputs, on both sides of 0; None for no clipping.
    """

    observation_space: Box | Discrete
    action_space: Box | Discrete
    sizes: tuple[int, ...]
    activation: tuple[str, ...]
    bias: bool
    output: str
    epsilon: float | None
    mean: np.ndarray | None = None
    scale: np.ndarray | None = None
    clip_obs: float | None = None

    @cached_property
    def shapes(self) -> list[tuple[int, int]]:
        """The shape of each layer's matrix: a row per neuron, a column per input."""
        return [
            (neurons, taken + self.bias)
            for taken, neurons in zip(self.sizes[:-1], self.sizes[1:], strict=True)
        ]

    @cached_property
    def ends(self) -> list[int]:
        """Where each layer's weights end; the last one is the number of weights."""
        return list(accumulate(prod(shape) for shape in self.shapes))

    @property
    def num_values(self) -> int:
        """The number of values to choose an action by: two even for a single output."""
        space = self.action_space
        return int(space.n) if isinstance(space, Discrete) else self.sizes[-1]

    @property
    def stretched_from(self) -> str | None:
        """The activation whose range is stretched to the bounds of a Box; None for no stretching.

        With noise, the outputs are the values of the action.
        """
        last = self.activation[-1]
        return last if last in HAVE_RANGE and self.output == "greedy" else None
