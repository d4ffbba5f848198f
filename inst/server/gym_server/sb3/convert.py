"""Read a zip file that Stable-Baselines3 saved, by its weights and by what it says in plain text.

Such a file holds objects as pickles, too. A pickle can run any program when it is loaded, so none
is loaded here.
"""

from __future__ import annotations

import json
import re
import threading
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.save_util import load_from_zip_file

from gym_server.sb3 import algorithms, policies
from gym_server.sb3.failures import JobError
from gym_server.sb3.networks import NotANetworkError, network_of

_NO_MODEL = "is no model that Stable-Baselines3 saved"


def convert(job: dict[str, Any], folder: Path, stopping: threading.Event) -> dict[str, Any]:
    """Write the policy of a zip file, as ``train()`` does.

    Args:
        job: the file, as ``file``; ``activation``, if it is given; ``moments``, with which the
            observations were normalized, or None.
        folder: where the policy goes.
        stopping: unused, because this takes no time.
    """
    path = Path(job["file"])
    said = _said(path)
    try:
        _, parameters, _ = load_from_zip_file(path, load_data=False, device="cpu")
    except Exception as failure:
        raise JobError(
            f'The weights in "{path.name}" cannot be read: {" ".join(str(failure).split())[:200]}',
            "They may be of another version of PyTorch, or hold more than weights: such a file "
            "could run any program, and is not loaded.",
            argument="x",
        ) from failure
    states = parameters.get("policy")
    if not isinstance(states, dict):
        raise JobError(f'"{path.name}" {_NO_MODEL}: it has no policy.', argument="x")
    weights = {name: np.asarray(value) for name, value in states.items() if torch.is_tensor(value)}
    about_policy = said.get("policy_kwargs") or {}
    named = re.search(r"(\w+)'>", str(about_policy.get("activation_fn", "")))
    moments = job["moments"]
    try:
        _check_plain(said)
        network = network_of(
            weights,
            _actions(said),
            job["activation"] or (named[1] if named else None),
            about_policy.get("squash_output") is True,
            float(about_policy.get("clip_mean", 2.0)),
        )
        inputs = network.layers[0].shape[1] - 1
        policies.write_network(folder, network, _moments(moments, inputs))
    except NotANetworkError as reason:
        algorithm, policy = _policy(said, path.name, reason)
        arguments = _arguments(said, job["activation"] or (named[1] if named else None))
        count = len(moments["mean"]) if moments else 0
        policies.write_states(
            folder, weights, algorithm, policy, arguments, _moments(moments, count)
        )
    return {"steps": said.get("num_timesteps"), "error": None}


def _said(path: Path) -> dict[str, Any]:
    try:
        with zipfile.ZipFile(path) as archive:
            said: dict[str, Any] = json.loads(archive.read("data"))
    except (OSError, KeyError, ValueError, zipfile.BadZipFile) as failure:
        raise JobError(f'"{path.name}" {_NO_MODEL}.', argument="x") from failure
    return said


def _check_plain(said: dict[str, Any]) -> None:
    if "maskable" in str((said.get("policy_class") or {}).get("__module__")):
        raise NotANetworkError("it needs the mask of valid actions")
    if "Dict" in str((said.get("observation_space") or {}).get(":type:")):
        raise NotANetworkError("its observations have several parts")


def _policy(said: dict[str, Any], name: str, reason: Exception) -> tuple[str, str]:
    """Return an algorithm that has the policy, and the policy's name there."""
    about = said.get("policy_class") or {}
    made = re.search(r"<function (\w+)\.__init__", str(about.get("__init__", "")))
    for algorithm in algorithms.NAMES:
        for alias, policy in algorithms.algorithm(algorithm).policy_aliases.items():
            if (about.get("__module__"), made and made[1]) == (policy.__module__, policy.__name__):
                return algorithm, alias
    raise JobError(
        f'The policy in "{name}" is not one of Stable-Baselines3, nor a network of R: {reason}.',
        "Train it again by `learn_sb3()`, or play it in Python.",
        argument="x",
    ) from reason


def _arguments(said: dict[str, Any], activation: str | None) -> dict[str, Any]:
    """Return the policy's arguments; those that only a pickle says are left out."""
    given = said.get("policy_kwargs") or {}
    plain = {
        name: value
        for name, value in given.items()
        if not name.startswith((":", "optimizer")) and not str(value).startswith("<")
    }
    if activation is not None:
        plain["activation_fn"] = activation
    own = {"policy_kwargs": plain}
    return {**own, "use_sde": True} if said.get("use_sde") else own


def _actions(said: dict[str, Any]) -> int | None:
    space = said.get("action_space") or {}
    kind = str(space.get(":type:", ""))
    if "Box" in kind:
        return None
    if ".discrete.Discrete'" in kind:
        if int(space.get("start", 0) or 0) != 0:
            raise NotANetworkError("its first action is not 0")
        return int(space["n"])
    raise JobError("Its actions are neither Discrete nor a Box.", argument="x")


def _moments(given: dict[str, Any] | None, inputs: int) -> dict[str, Any] | None:
    if given is None:
        return None
    for name in ("mean", "variance"):
        if len(given[name]) != inputs:
            raise JobError(
                f"`moments${name}` must have {inputs} numbers, one for each of an observation, "
                f"not {len(given[name])}.",
                argument="moments",
            )
    epsilon = given.get("epsilon", 1e-8)
    variance = np.asarray(given["variance"], np.float64) + epsilon
    return {
        "mean": np.asarray(given["mean"], np.float64),
        "variance": variance,
        "count": 1e6,
        "clip_obs": given.get("clip_obs", 10.0),
    }
