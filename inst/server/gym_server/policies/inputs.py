"""From an observation to the inputs of a network, as float64."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Discrete, Space

from gym_server.errors import GymServerError
from gym_server.json_values import brief
from gym_server.policies.activation import Steps
from gym_server.policies.states import states_of


class Moments(NamedTuple):
    """What inputs are normalised by: ``(x - mean) * scale``.

    Attributes:
        mean: float64[inputs].
        scale: float64[inputs].
    """

    mean: np.ndarray
    scale: np.ndarray


def with_bias(*shape: int, bias: bool) -> np.ndarray:
    """Return a buffer for what a layer takes; with a bias it has a 1 below the inputs."""
    inputs, *rest = shape
    return np.ones((inputs + bias, *rest))


def box_reader(space: Space, inputs: np.ndarray) -> Callable[[Any], None]:
    """Return a function that copies an observation into an array."""
    # In the shape of the observation: a copy that also changes the shape takes longer.
    target = inputs.reshape(space.shape)
    copyto = np.copyto

    def read(observation: Any) -> None:
        try:
            copyto(target, observation)
        except (ValueError, TypeError):
            raise misfit(observation) from None

    return read


def column_reader(space: Discrete, columns: np.ndarray, sums: np.ndarray) -> Callable[[Any], None]:
    """Return a function that copies the sums of the first layer for a discrete observation.

    Of inputs that are 0 but for one that is 1, they are a column of the weights.

    Args:
        space: the observations.
        columns: float64[observations, neurons].
        sums: where to copy to.
    """
    index = index_of(space)

    def read(observation: Any) -> None:
        sums[...] = columns[index(observation)]

    return read


def index_of(space: Discrete) -> Callable[[Any], int]:
    """Return a function that numbers the values of a space from 0."""
    states = states_of(space)
    assert states is not None

    def index(observation: Any) -> int:
        try:
            return states.index(observation)
        except (ValueError, TypeError):
            raise misfit(observation) from None

    return index


def indices_of(space: Discrete) -> Callable[[Any], np.ndarray]:
    """Return ``index_of()`` for batches."""
    first, n = int(space.start), int(space.n)

    def indices(observation: Any) -> np.ndarray:
        beyond = np.asarray(observation).astype(np.int64) - first
        wrong = (beyond < 0) | (beyond >= n)
        if wrong.any():
            raise misfit(np.asarray(observation)[wrong][0])
        return beyond

    return indices


def normalizing(inputs: np.ndarray, moments: Moments | None) -> Steps:
    """Return the calls that normalise inputs where they are."""
    if moments is None:
        return []
    across = (-1,) + (1,) * (inputs.ndim - 1)
    mean, scale = moments.mean.reshape(across), moments.scale.reshape(across)
    return [
        lambda: np.subtract(inputs, mean, inputs),
        lambda: np.multiply(inputs, scale, inputs),
    ]


def misfit(observation: Any) -> GymServerError:
    """An observation is not in the space that the environment says it is in."""
    return GymServerError(
        "environment_error",
        f"The environment's observation {brief(observation)} is not in its observation space",
    )
