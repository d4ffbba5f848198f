"""R and Python clients at once, whose trajectories must all equal Gymnasium's.

    tools/in-env python tools/soak/clients.py [CLIENTS [STEPS]]

All play at the same time on one server. Their observations are compared, number by number, with
the same environments played in this process.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import gymnasium
import numpy as np
from serving import SERVER, Client, ServerProcess

HERE = Path(__file__).parent

SEEN = ("observation", "reward", "terminated", "truncated")

# Sub-environments use tensors, and so do all observations in R.
KINDS = [
    {"env_id": "CartPole-v1"},
    {"env_id": "Pendulum-v1"},
    {"env_id": "FrozenLake-v1"},
    {"env_id": "CartPole-v1", "num_envs": 8},
    {"env_id": "Acrobot-v1"},
    {"env_id": "Pendulum-v1", "num_envs": 4},
    {"env_id": "MountainCar-v0", "num_envs": 3},
    {"env_id": "faulty_envs:Counting-v0"},
]


def plan(number: int, steps: int, folder: Path) -> dict:
    """Write the task of one client; pairs of an R and a Python client play the same."""
    kind = KINDS[number // 2 % len(KINDS)]
    num_envs = kind.get("num_envs", 1)
    rng = np.random.default_rng(number)
    env = gymnasium.make(kind["env_id"])
    box = isinstance(env.action_space, gymnasium.spaces.Box)
    actions = (
        rng.uniform(-2, 2, (steps, num_envs)) if box else rng.integers(0, 2, (steps, num_envs))
    )
    # As on the server, which rounds to the dtype of the action space.
    actions = actions.astype(np.float32 if box else np.int64).astype(np.float64)
    env.close()
    actions.tofile(folder / f"{number}.actions")
    task = {**kind, "actions_a_step": num_envs, "box": box, "seed": 1000 + number, "steps": steps}
    task |= {"actions": str(folder / f"{number}.actions"), "seen": str(folder / f"{number}.seen")}
    (folder / f"{number}.json").write_text(json.dumps(task))
    return task


def play_here(task: dict) -> np.ndarray:
    """Return the expected values, from Gymnasium in this process."""
    num_envs, box = task["actions_a_step"], task["box"]
    vector = "num_envs" in task
    if vector:
        # As the server chooses: the environment's own class if it has one.
        own = gymnasium.spec(task["env_id"]).vector_entry_point is not None
        mode = "vector_entry_point" if own else "sync"
        env = gymnasium.make_vec(task["env_id"], num_envs=num_envs, vectorization_mode=mode)
    else:
        env = gymnasium.make(task["env_id"])
    seen = []
    observation, _ = env.reset(seed=task["seed"])
    for row in np.fromfile(task["actions"]).reshape(-1, num_envs):
        if box:
            action = row.astype(np.float32).reshape((num_envs, 1) if vector else (1,))
        else:
            action = row.astype(np.int64) if vector else int(row[0])
        observation, reward, terminated, truncated, _ = env.step(action)
        seen += [observation, reward, terminated, truncated]
        if not vector and (terminated or truncated):
            observation, _ = env.reset()
            seen.append(observation)
    env.close()
    return np.concatenate([np.asarray(part, np.float64).ravel() for part in seen])


def play_there(port: int, task: dict) -> None:
    """Play over HTTP like this client."""
    num_envs, box = task["actions_a_step"], task["box"]
    client = Client(port)
    fields = {name: task[name] for name in ("env_id", "num_envs") if name in task}
    url = f"/v1/envs/{client.post('/v1/envs/', **fields)['instance_id']}"
    seen = []
    if "num_envs" in task:
        client.post(f"{url}/reset/", seed=task["seed"])
        for row in np.fromfile(task["actions"]).reshape(-1, num_envs):
            action = [[number] for number in row] if box else [int(number) for number in row]
            answer = client.post_for_tensors(f"{url}/step/", action=action)
            seen += [_numbers(*answer[name]) for name in SEEN]
    else:
        client.post(f"{url}/reset/", seed=task["seed"])
        for (number,) in np.fromfile(task["actions"]).reshape(-1, 1):
            answer = client.post(f"{url}/step/", action=[number] if box else int(number))
            seen += [answer[name] for name in SEEN]
            if answer["done"]:
                seen.append(client.post(f"{url}/reset/")["observation"])
    client.post(f"{url}/close/")
    flat = [np.asarray(part, np.float64).ravel() for part in seen]
    np.concatenate(flat).tofile(task["seen"])


_DTYPES = {"F32": "<f4", "F64": "<f8", "BOOL": "?", "I64": "<i8"}


def _numbers(dtype: str, shape: list[int], data: bytes) -> np.ndarray:
    return np.frombuffer(data, _DTYPES[dtype]).reshape(shape)


def start(number: int, port: int, folder: Path) -> subprocess.Popen:
    """Start one client; every other one is R."""
    task = folder / f"{number}.json"
    if number % 2:
        command = [sys.executable, __file__, "play", str(port), str(task)]
    else:
        command = ["Rscript", "--no-init-file", str(HERE / "clients.R"), str(port), str(task)]
    return subprocess.Popen(command)


def main(clients: int, steps: int) -> int:
    """Play and compare; return the exit status."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plans = [plan(number, -(-steps // clients), folder) for number in range(clients)]
        server = ServerProcess()
        began = time.monotonic()
        players = [start(number, server.port, folder) for number in range(clients)]
        failed = sum(player.wait() != 0 for player in players)
        seconds = time.monotonic() - began
        left = Client(server.port).get("/v1/health/")["instances"]
        server.stop()
        differing = [task for task in plans if not _is_same(task)]
    for task in differing:
        print(f"differs: {task}", flush=True)
    taken = sum(task["steps"] for task in plans)
    print(
        f"clients: {taken} steps of {clients} clients in {seconds:.0f} s, trajectories that differ "
        f"{len(differing)}, clients that failed {failed}, environments left {left}"
    )
    return int(bool(differing or failed or left))


def _is_same(task: dict) -> bool:
    if not os.path.exists(task["seen"]):
        return False
    return np.array_equal(np.fromfile(task["seen"]), play_here(task), equal_nan=True)


if __name__ == "__main__":
    sys.path.append(str(SERVER / "tests"))
    if sys.argv[1:2] == ["play"]:
        play_there(int(sys.argv[2]), json.loads(Path(sys.argv[3]).read_text()))
    else:
        sys.exit(main(*map(int, sys.argv[1:])) if sys.argv[1:] else main(32, 200_000))
