"""A server that supports only the protocol of gym-http-api, for tests of the client.

    python classic_server.py

It has only that protocol's routes, ignores unknown fields, sends errors in JSON, and answers an
unknown route in HTML, like Flask. Steps have no truncation, as in Gym at the time. Prints its port,
and ends when its standard input closes.
"""

import secrets
import sys
import threading

import flask
import gymnasium
import numpy as np
from werkzeug.serving import make_server

app = flask.Flask(__name__)
envs = {}


class Refused(Exception):
    """The request cannot be carried out."""


@app.errorhandler(Refused)
def refuse(refusal):
    return {"message": str(refusal)}, 400


def env_of(instance_id):
    if instance_id not in envs:
        raise Refused(f"Instance_id {instance_id} unknown")
    return envs[instance_id]


def jsonable(value):
    if isinstance(value, tuple):
        return [jsonable(part) for part in value]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


def info_of(space):
    info = {"name": type(space).__name__}
    if info["name"] == "Discrete":
        info["n"] = int(space.n)
    elif info["name"] == "Box":
        bounds = (np.nan_to_num(b.astype(float), posinf=1e100, neginf=-1e100) for b in
                  (space.low.flatten(), space.high.flatten()))
        info["shape"] = space.shape
        info["low"], info["high"] = (bound.tolist() for bound in bounds)
    return {"info": info}


@app.post("/v1/envs/")
def create():
    env_id = flask.request.get_json()["env_id"]
    try:
        env = gymnasium.make(env_id)
    except gymnasium.error.Error:
        raise Refused(f"Attempted to look up malformed environment ID '{env_id}'") from None
    instance_id = secrets.token_hex(4)
    envs[instance_id] = env
    return {"instance_id": instance_id}


@app.get("/v1/envs/")
def list_all():
    return {"all_envs": {instance_id: env.spec.id for instance_id, env in envs.items()}}


@app.post("/v1/envs/<instance_id>/reset/")
def reset(instance_id):
    return {"observation": jsonable(env_of(instance_id).reset()[0])}


@app.post("/v1/envs/<instance_id>/step/")
def step(instance_id):
    env = env_of(instance_id)
    action = flask.request.get_json().get("action")
    if action is None or action == "" or action == []:
        raise Refused("A required request parameter 'action' was not provided")
    action = action if isinstance(action, int) else np.array(action, dtype=np.float32)
    observation, reward, terminated, truncated, info = env.step(action)
    done = terminated or truncated
    if done:
        info["TimeLimit.truncated"] = not terminated
    return {
        "observation": jsonable(observation), "reward": float(reward), "done": bool(done),
        "info": {key: value for key, value in info.items() if isinstance(value, (bool, float))},
    }


@app.get("/v1/envs/<instance_id>/action_space/")
def action_space_info(instance_id):
    return info_of(env_of(instance_id).action_space)


@app.get("/v1/envs/<instance_id>/action_space/sample")
def action_space_sample(instance_id):
    return {"action": jsonable(env_of(instance_id).action_space.sample())}


@app.get("/v1/envs/<instance_id>/action_space/contains/<x>")
def action_space_contains(instance_id, x):
    return {"member": bool(env_of(instance_id).action_space.contains(int(x)))}


@app.get("/v1/envs/<instance_id>/observation_space/")
def observation_space_info(instance_id):
    return info_of(env_of(instance_id).observation_space)


@app.post("/v1/envs/<instance_id>/monitor/start/")
@app.post("/v1/envs/<instance_id>/monitor/close/")
def monitor(instance_id):
    env_of(instance_id)
    return "", 204


@app.post("/v1/envs/<instance_id>/close/")
def close(instance_id):
    env_of(instance_id).close()
    del envs[instance_id]
    return "", 204


@app.post("/v1/shutdown/")
def shutdown():
    return "Server shutting down"


server = make_server("127.0.0.1", 0, app)
print(server.server_port, flush=True)
threading.Thread(target=server.serve_forever, daemon=True).start()
sys.stdin.read()
