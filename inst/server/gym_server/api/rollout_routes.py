"""The route that plays whole episodes in the server's processes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from gym_server.api import env_fields
from gym_server.api.calls import Call
from gym_server.api.routing import RouteBlueprint
from gym_server.envs.config import EnvConfig
from gym_server.errors import GymServerError, answer_to, invalid_parameter
from gym_server.protocol.answers import dumps, tensor_response
from gym_server.protocol.fields import OBJECT, Field, Kind
from gym_server.protocol.safetensors import Tensor
from gym_server.response import Response
from gym_server.rollouts.environment import GROUP
from gym_server.rollouts.task import Keep, Unit

bp = RouteBlueprint("rollouts")

_KEPT = ("moments", "steps", "next_observation")


def _keep(value: object) -> Keep:
    if not isinstance(value, list) or not all(name in _KEPT for name in value):
        raise ValueError
    return Keep(**dict.fromkeys(value, True))


_KEEP = Kind(f"a list of some of {', '.join(_KEPT)}", _keep)


@bp.declare(
    "POST",
    "/v1/rollouts/",
    Field("env_id", env_fields.ANY_ID, required=True),
    Field("kwargs", OBJECT),
    Field("wrappers", env_fields.WRAPPERS),
    Field("policy", OBJECT),
    Field("max_steps", env_fields.POSITIVE),
    Field("keep", _KEEP),
    tensors=True,
    tensor_body=True,
)
def rollouts(call: Call) -> dict | Response:
    """Play whole episodes with a policy that is sent as data."""
    given = call.fields
    config = EnvConfig(
        env_id=given["env_id"], kwargs=given["kwargs"], wrappers=given["wrappers"] or ()
    )
    tensors: Mapping[str, Tensor] = call.body.get("tensors") or {}
    task = call.services.instances.rollout_task(
        config,
        policy=given["policy"] or {},
        tensors=_policy_tensors(tensors),
        max_steps=given["max_steps"],
        keep=given["keep"] or Keep(),
    )
    if "seed" not in tensors:
        return call.services.rollouts.describe(task)
    if given["policy"] is None:
        raise GymServerError("missing_parameter", "Episodes need the parameter 'policy'")
    units = _units(tensors)
    played, error = call.services.rollouts.play(task, units, call.is_connected)
    metadata = {}
    if error is not None:
        status, body = answer_to(error)
        metadata["error"] = dumps({"status": status, "body": body}).decode("ascii")
    arrays = {name: tensor.array() for name, tensor in played.items()}
    return tensor_response(arrays, metadata, call.form.by_column)


def _policy_tensors(tensors: Mapping[str, Tensor]) -> dict[str, np.ndarray]:
    prefix = "policy/"
    return {
        name.removeprefix(prefix): tensor.array()
        for name, tensor in tensors.items()
        if name.startswith(prefix)
    }


def _units(tensors: Mapping[str, Tensor]) -> list[Unit]:
    """Return the units to play: single episodes, or groups."""
    seeds = _integers(tensors, "seed", 2**53)
    count = len(seeds)
    if count == 0:
        raise GymServerError("invalid_parameter", "The tensor 'seed' has no episodes")
    candidates = _integers(tensors, "candidate", 2**31 - 1, count)
    if "row" not in tensors:
        return [Unit(seed, (one,)) for seed, one in zip(seeds, candidates, strict=True)]
    rows = _integers(tensors, "row", GROUP - 1, count)
    units = []
    first = 0
    for episode in range(1, count + 1):
        if episode == count or seeds[episode] != seeds[first] or rows[episode] <= rows[episode - 1]:
            own = slice(first, episode)
            units.append(Unit(seeds[first], tuple(candidates[own]), tuple(rows[own])))
            first = episode
    return units


def _integers(
    tensors: Mapping[str, Tensor], name: str, most: int, count: int | None = None
) -> list[int]:
    """Return a tensor with one dimension; if it is missing and the length is known, zeros."""
    if name not in tensors and count is not None:
        return [0] * count
    array: Any = tensors[name].array()
    wanted = f"a tensor of {'integers' if count is None else f'{count} integers'} from 0 to {most}"
    if (
        array.ndim != 1
        or array.dtype.kind not in "iu"
        or (count is not None and len(array) != count)
    ):
        found = json.dumps([tensors[name].dtype, list(tensors[name].shape)])
        raise invalid_parameter(name, found, wanted)
    wrong = array[(array < 0) | (array > most)]
    if len(wrong):
        raise invalid_parameter(name, int(wrong[0]), wanted)
    values: list[int] = array.tolist()
    return values
