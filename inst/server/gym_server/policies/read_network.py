"""Read a policy of networks, and refuse one that does not fit the environment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import prod

import numpy as np
from gymnasium.spaces import Box, Discrete, Space

from gym_server.errors import GymServerError, invalid_policy
from gym_server.json_values import brief
from gym_server.policies.activation import NAMES
from gym_server.policies.fields import (
    check_fields,
    count_of,
    epsilon_of,
    finite_numbers,
    shape_text,
)
from gym_server.policies.inputs import Moments
from gym_server.policies.network import NetworkPolicy
from gym_server.policies.network_plan import NetworkPlan
from gym_server.spaces import brief_space

_OUTPUTS = ("greedy", "softmax", "gaussian", "epsilon-greedy")


def read_network(
    document: Mapping,
    tensors: Mapping[str, np.ndarray],
    observation_space: Space,
    action_space: Space,
) -> NetworkPolicy:
    """Read candidates that are networks of the same sizes."""
    check_fields(
        document,
        tensors,
        *("sizes", "activation", "bias", "output", "epsilon"),
        *("weights", "mean", "scale", "deviation"),
    )
    sizes = _sizes(document)
    observed = _check_inputs(sizes, observation_space)
    acted = _check_outputs(sizes, action_space)
    activation = _activation(document, len(sizes) - 1)
    output = _output(document, sizes, acted)
    plan = NetworkPlan(sizes, activation, _bias(document))
    weights = _weights(tensors, plan)
    plan = replace(
        plan,
        moments=_moments(tensors, sizes[0], observed),
        output=output,
        epsilon=_epsilon(document, output),
        deviation=_deviation(tensors, output, (len(weights), sizes[-1])),
    )
    if isinstance(acted, Box) and plan.stretched_from is not None:
        _check_bounded(acted, plan.stretched_from)
    return NetworkPolicy(plan, weights, observed, acted)


def _sizes(document: Mapping) -> tuple[int, ...]:
    sizes = document.get("sizes")
    if (
        not isinstance(sizes, list)
        or len(sizes) < 2
        or not all(type(size) is int and size >= 1 for size in sizes)
    ):
        raise invalid_policy(
            f"The policy's sizes must be two or more whole numbers from 1, not {brief(sizes)}"
        )
    return tuple(sizes)


def _activation(document: Mapping, layers: int) -> tuple[str, ...]:
    names = document.get("activation")
    if not isinstance(names, list) or len(names) != layers:
        raise invalid_policy(
            f"The policy's activation must be {count_of(layers, 'name')}, one for each layer after "
            f"the inputs, not {brief(names)}"
        )
    for name in names:
        if name not in NAMES:
            raise invalid_policy(
                f"There is no activation {brief(name)}", f"there are {', '.join(NAMES)}"
            )
    return tuple(names)


def _bias(document: Mapping) -> bool:
    bias = document.get("bias", False)
    if not isinstance(bias, bool):
        raise invalid_policy(f"The policy's bias must be true or false, not {brief(bias)}")
    return bias


def _supported(space: Space, do: str, what: str) -> Box | Discrete:
    if isinstance(space, (Box, Discrete)):
        return space
    raise GymServerError(
        "not_supported",
        f"A network cannot {do} {brief_space(space)}",
        f"networks need {what} of a Box or a Discrete space",
    )


def _check_inputs(sizes: tuple[int, ...], space: Space) -> Box | Discrete:
    space = _supported(space, "observe", "observations")
    gives = _width(space)
    if sizes[0] != gives:
        kind = (
            f"is one of {gives:,} and needs an input for each"
            if isinstance(space, Discrete)
            else f"has {count_of(gives, 'number')}"
        )
        raise invalid_policy(
            f"The network takes {count_of(sizes[0], 'input')}, but an observation of the "
            f"environment {kind}",
            f"make the first of its sizes {gives}",
        )
    return space


def _check_outputs(sizes: tuple[int, ...], space: Space) -> Box | Discrete:
    space = _supported(space, "choose from", "actions")
    width, outputs = _width(space), sizes[-1]
    is_discrete = isinstance(space, Discrete)
    if outputs != width and not (is_discrete and outputs == 1 and width == 2):
        takes = "has" if is_discrete else "takes an action of"
        raise invalid_policy(
            f"The network gives {count_of(outputs, 'output')}, but the environment {takes} "
            f"{count_of(width, 'action' if is_discrete else 'number')}",
            f"make the last of its sizes {width}",
        )
    return space


def _width(space: Box | Discrete) -> int:
    return int(space.n) if isinstance(space, Discrete) else prod(space.shape)


def _check_bounded(space: Box, activation: str) -> None:
    if not (np.isfinite(space.low).all() and np.isfinite(space.high).all()):
        raise invalid_policy(
            f'The outputs of "{activation}" are scaled to the bounds of the action, but the '
            f"environment takes {brief_space(space)} with a side without a bound",
            'outputs of "identity" are taken as they are',
        )


def _output(document: Mapping, sizes: tuple[int, ...], space: Box | Discrete) -> str:
    output = document.get("output", "greedy")
    if output not in _OUTPUTS:
        raise invalid_policy(
            f"The policy's output must be one of {', '.join(_OUTPUTS)}, not {brief(output)}"
        )
    wanted = {"softmax": Discrete, "epsilon-greedy": Discrete, "gaussian": Box}.get(output)
    if wanted is not None and not isinstance(space, wanted):
        raise invalid_policy(
            f'The output "{output}" needs actions of a {wanted.__name__} space, and the '
            f"environment takes {brief_space(space)}"
        )
    if output == "softmax" and sizes[-1] != _width(space):
        raise invalid_policy(
            f'The output "softmax" needs an output for each of the {_width(space)} actions, and '
            f"the network gives {sizes[-1]}",
            f"make the last of its sizes {_width(space)}",
        )
    return str(output)


def _epsilon(document: Mapping, output: str) -> float:
    epsilon = epsilon_of(document, None)
    if output == "epsilon-greedy" and epsilon is None:
        raise invalid_policy('The output "epsilon-greedy" needs an epsilon, a number from 0 to 1')
    return epsilon or 0.0


def _weights(tensors: Mapping[str, np.ndarray], plan: NetworkPlan) -> np.ndarray:
    weights = finite_numbers(tensors, "weights")
    if weights.ndim != 2 or not len(weights) or weights.shape[1] != plan.ends[-1]:
        sizes = "-".join(map(str, plan.sizes)) + (" with a bias" if plan.bias else "")
        raise invalid_policy(
            f"The policy's weights must be a row of {count_of(plan.ends[-1], 'number')} for each "
            f"candidate, because its network is {sizes}, not {shape_text(weights.shape)}"
        )
    return weights


def _moments(
    tensors: Mapping[str, np.ndarray], inputs: int, space: Box | Discrete
) -> Moments | None:
    if not {"mean", "scale"} & tensors.keys():
        return None
    if isinstance(space, Discrete):
        raise invalid_policy(
            f"Observations that are numbers of a range can be normalised, but those of the "
            f"environment are {brief_space(space)}",
            "make the policy without mean and scale",
        )
    moments = Moments(finite_numbers(tensors, "mean"), finite_numbers(tensors, "scale"))
    for name, tensor in moments._asdict().items():
        if tensor.shape != (inputs,):
            raise invalid_policy(
                f"The policy's {name} must be a number for each of its "
                f"{count_of(inputs, 'input')}, not {shape_text(tensor.shape)}"
            )
    return moments


def _deviation(
    tensors: Mapping[str, np.ndarray], output: str, shape: tuple[int, int]
) -> np.ndarray | None:
    if output != "gaussian":
        if "deviation" in tensors:
            raise invalid_policy(
                f'Standard deviations belong to the output "gaussian", not to "{output}"',
                "leave the tensor deviation out",
            )
        return None
    deviation = finite_numbers(tensors, "deviation")
    if deviation.shape not in (shape, shape[1:]):
        raise invalid_policy(
            f"The policy's deviation must be a number for each of its "
            f"{count_of(shape[1], 'output')}, or a row of these for each candidate, not "
            f"{shape_text(deviation.shape)}"
        )
    if (deviation < 0).any():
        raise invalid_policy(
            f"The policy's deviation must be numbers from 0, not {brief(float(deviation.min()))}"
        )
    return np.ascontiguousarray(np.broadcast_to(deviation, shape))
