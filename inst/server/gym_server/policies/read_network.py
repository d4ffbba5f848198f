"""Read a policy of networks, and refuse one that does not fit the environment."""

from __future__ import annotations

from collections.abc import Mapping
from math import prod

import numpy as np
from gymnasium.spaces import Box, Discrete, Space

from gym_server.errors import GymServerError, invalid_policy
from gym_server.json_values import brief
from gym_server.policies.activation import NAMES
from gym_server.policies.layers import NetworkPlan
from gym_server.policies.network import NetworkPolicy
from gym_server.policies.reading import (
    above_zero,
    check_fields,
    count_of,
    epsilon_of,
    field,
    finite_numbers,
)
from gym_server.spaces import brief_space


def read_network(
    document: Mapping,
    tensors: Mapping[str, np.ndarray],
    observation_space: Space,
    action_space: Space,
) -> NetworkPolicy:
    """Read candidates that are networks of the same sizes."""
    observed, acted = _supported(observation_space), _supported(action_space)
    check_fields(
        document,
        tensors,
        *("sizes", "activation", "bias", "output", "epsilon", "clip_obs", "weights"),
        *(("mean", "scale") if isinstance(observed, Box) else ()),
        *(("deviation",) if document.get("output") == "gaussian" else ()),
    )
    sizes = field(document, "sizes", _are_sizes, "two or more whole numbers from 1")
    _check_ends(sizes, observed, acted)
    plan = NetworkPlan(
        observed,
        acted,
        tuple(sizes),
        activation=_activation(document, len(sizes) - 1),
        bias=field(document, "bias", _is_flag, "true or false") or False,
        output=_output(document, sizes[-1], acted),
        epsilon=epsilon_of(document),
        **_moments(tensors, sizes[0]),
        clip_obs=above_zero(document, "clip_obs"),
    )
    if plan.output == "epsilon-greedy" and plan.epsilon is None:
        raise invalid_policy('The output "epsilon-greedy" needs an epsilon, a number from 0 to 1')
    if plan.stretched_from is not None and isinstance(acted, Box) and not acted.is_bounded():
        raise invalid_policy(
            f'The outputs of "{plan.stretched_from}" are scaled to the bounds of the action, but '
            f"the environment takes {brief_space(acted)} with a side without a bound",
            'outputs of "identity" are taken as they are',
        )
    network = "-".join(map(str, sizes)) + (" with a bias" if plan.bias else "")
    row = f"a row of {count_of(plan.ends[-1], 'number')} for each candidate, as {network} needs"
    weights = finite_numbers(tensors, "weights", [(None, plan.ends[-1])], row)
    return NetworkPolicy(plan, weights, _deviation(tensors, plan, len(weights)))


def _supported(space: Space) -> Box | Discrete:
    if isinstance(space, (Box, Discrete)):
        return space
    raise GymServerError(
        "not_supported",
        f"A network cannot observe or choose from {brief_space(space)}",
        "networks need observations and actions of a Box or a Discrete space",
    )


def _are_sizes(value: object) -> bool:
    if not isinstance(value, list) or len(value) < 2:
        return False
    return all(type(size) is int and size >= 1 for size in value)


def _is_flag(value: object) -> bool:
    return value is None or isinstance(value, bool)


def _check_ends(sizes: list[int], observed: Box | Discrete, acted: Box | Discrete) -> None:
    """Refuse a network whose inputs or outputs do not fit the environment."""
    inputs, outputs = _width(observed), _width(acted)
    chooses_by_one = isinstance(acted, Discrete) and (outputs, sizes[-1]) == (2, 1)
    if sizes[0] != inputs or (sizes[-1] != outputs and not chooses_by_one):
        raise invalid_policy(
            f"The network takes {count_of(sizes[0], 'input')} and gives "
            f"{count_of(sizes[-1], 'output')}, but an observation of {brief_space(observed)} "
            f"needs {inputs}, and an action of {brief_space(acted)} needs {outputs}",
            f"make the first of its sizes {inputs}, and the last {outputs}",
        )


def _width(space: Box | Discrete) -> int:
    return int(space.n) if isinstance(space, Discrete) else prod(space.shape)


def _activation(document: Mapping, layers: int) -> tuple[str, ...]:
    def fits(value: object) -> bool:
        return isinstance(value, list) and len(value) == layers and all(v in NAMES for v in value)

    wanted = (
        f"{count_of(layers, 'name')} of {', '.join(NAMES)}, one for each layer after the inputs"
    )
    return tuple(field(document, "activation", fits, wanted))


def _output(document: Mapping, outputs: int, space: Box | Discrete) -> str:
    names = ["greedy"] if isinstance(space, Box) else ["greedy", "epsilon-greedy"]
    if isinstance(space, Box) and space.dtype.kind == "f":
        names.append("gaussian")
    if isinstance(space, Discrete) and outputs == space.n:
        names.append("softmax")
    output = document.get("output", "greedy")
    if output not in names:
        raise invalid_policy(
            f"The policy's output must be one of {', '.join(names)} with "
            f"{count_of(outputs, 'output')} for {brief_space(space)}, not {brief(output)}"
        )
    return str(output)


def _moments(tensors: Mapping[str, np.ndarray], inputs: int) -> dict[str, np.ndarray]:
    if not {"mean", "scale"} & tensors.keys():
        return {}
    wanted = f"a number for each of its {count_of(inputs, 'input')}"
    return {name: finite_numbers(tensors, name, [(inputs,)], wanted) for name in ("mean", "scale")}


def _deviation(
    tensors: Mapping[str, np.ndarray], plan: NetworkPlan, candidates: int
) -> np.ndarray | None:
    if plan.output != "gaussian":
        return None
    shape = (candidates, plan.sizes[-1])
    wanted = (
        f"a number for each of its {count_of(shape[1], 'output')}, or a row of these for each "
        "candidate"
    )
    deviation = finite_numbers(tensors, "deviation", [shape, shape[1:]], wanted)
    if (deviation < 0).any():
        raise invalid_policy(
            f"The policy's deviation must be numbers from 0, not {brief(float(deviation.min()))}"
        )
    return np.ascontiguousarray(np.broadcast_to(deviation, shape))
