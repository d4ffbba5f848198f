"""Checkpoints: a folder with a model's zip, its replay buffer and its moments.

Nothing in it is unpickled. A training goes on with a new model of the same arguments, which takes
the weights, the optimizers' states and the arrays.
"""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.save_util import load_from_zip_file, recursive_setattr

from gym_server.sb3 import files
from gym_server.sb3.failures import JobError

# Larger replay buffers are left out: a training that goes on then first collects steps again.
LARGEST_BUFFER = 4 * 2**30

_COUNTERS = ("num_timesteps", "_n_updates", "_episode_num", "_n_calls")
_ARRAYS = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def keep(model: BaseAlgorithm, folder: Path, rows: int, elapsed: float) -> None:
    """Replace the checkpoint."""
    new, old = folder / "checkpoint-new", folder / "checkpoint-old"
    shutil.rmtree(new, ignore_errors=True)
    new.mkdir()
    model.save(new / "model.zip")
    buffer = _buffer_of(model)
    if buffer is not None and sum(array.nbytes for array in buffer.values()) <= LARGEST_BUFFER:
        np.savez(new / "buffer.npz", **buffer)
    for name, found in _moments_of(model).items():
        np.savez(new / f"{name}.npz", mean=found.mean, var=found.var, count=found.count)
    state = {name: getattr(model, name) for name in _COUNTERS if hasattr(model, name)}
    files.write_json(new / "state.json", {**state, "rows": rows, "elapsed": elapsed})
    shutil.rmtree(old, ignore_errors=True)
    if (folder / "checkpoint").exists():
        os.replace(folder / "checkpoint", old)
    os.replace(new, folder / "checkpoint")
    shutil.rmtree(old, ignore_errors=True)


def _buffer_of(model: BaseAlgorithm) -> dict[str, Any] | None:
    buffer = getattr(model, "replay_buffer", None)
    if buffer is None or isinstance(buffer.observations, dict):
        return None
    filled = buffer.buffer_size if buffer.full else buffer.pos
    arrays = {name: getattr(buffer, name)[:filled] for name in _ARRAYS if hasattr(buffer, name)}
    return {**arrays, "pos": np.array(buffer.pos), "full": np.array(buffer.full)}


def _moments_of(model: BaseAlgorithm) -> dict[str, Any]:
    # Observations have some if they are normalized, the returns always.
    env = model.get_vec_normalize_env()
    return {name: getattr(env, name) for name in ("obs_rms", "ret_rms") if hasattr(env, name)}


def _place(folder: Path) -> Path | None:
    # A crash while one was replaced leaves the one before.
    places = (folder / "checkpoint", folder / "checkpoint-old")
    return next((place for place in places if (place / "state.json").exists()), None)


def state_of(folder: Path) -> dict[str, Any]:
    """Return the counters of the model, its rows and seconds; empty without a checkpoint."""
    place = _place(folder)
    if place is None:
        return {}
    found: dict[str, Any] = json.loads((place / "state.json").read_text(encoding="utf-8"))
    return found


def restore(model: BaseAlgorithm, folder: Path) -> None:
    """Give a new model the state of the checkpoint, if there is one.

    Raises:
        JobError: a file of it is damaged.
    """
    place = _place(folder)
    if place is None:
        return
    try:
        _restore(model, place, state_of(folder))
    except Exception as failure:
        raise JobError(
            f"The checkpoint in {place} is damaged: {' '.join(str(failure).split())[:200]}",
            "Put its files back, or give `resume = FALSE` to start again.",
            checkpoint=True,
        ) from failure


def _restore(model: BaseAlgorithm, place: Path, state: dict[str, Any]) -> None:
    _, parameters, variables = load_from_zip_file(
        place / "model.zip", device=model.device, load_data=False
    )
    model.set_parameters(parameters, device=model.device)
    for name, value in (variables or {}).items():
        # As in BaseAlgorithm.load(): the optimizer of a variable refers to it.
        recursive_setattr(model, f"{name}.data", value.data)
    for name, value in state.items():
        if name in _COUNTERS:
            setattr(model, name, value)
    for name, found in _moments_of(model).items():
        with np.load(place / f"{name}.npz", allow_pickle=False) as saved:
            found.mean, found.var = saved["mean"], saved["var"]
            found.count = float(saved["count"])
    buffer: Any = getattr(model, "replay_buffer", None)
    if buffer is not None and (place / "buffer.npz").exists():
        with np.load(place / "buffer.npz", allow_pickle=False) as saved:
            for name in _ARRAYS:
                if name in saved:
                    getattr(buffer, name)[: len(saved[name])] = saved[name]
            buffer.pos, buffer.full = int(saved["pos"]), bool(saved["full"])
    elif buffer is not None:
        # It collects as many steps as at the beginning before it learns from them.
        starts: Any = model
        starts.learning_starts += model.num_timesteps
