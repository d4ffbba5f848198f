"""Play environments in process and write the results to files, for test-parity.R.

Usage: reference_trajectories.py DIRECTORY < LINES, each with the name of a file to write, an
environment's id and a number of steps. A file has for the first reset and each step, in order: the
observation (its parts in order, row by row, bytes if the dtype is uint8, else doubles), and for a
step also reward, terminated and truncated as doubles; after the first reset and every tenth step a
frame as bytes, if there are frames. Everything is little-endian. A file gets its name when it is
complete. A file with the suffix ".failed" says why there is none.
"""

import os
import sys

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("SDL_AUDIODRIVER", "dummy")

import gymnasium as gym
import numpy as np
from gym_server.envs import mujoco

try:
    import ale_py

    gym.register_envs(ale_py)
except ImportError:
    pass

SEED = 7


def leaves(space, value):
    """Yield the parts of a member as bytes."""
    if isinstance(space, gym.spaces.Dict):
        for key, part in space.spaces.items():
            yield from leaves(part, value[key])
    elif isinstance(space, gym.spaces.Tuple):
        for part, item in zip(space.spaces, value, strict=True):
            yield from leaves(part, item)
    else:
        yield np.asarray(value).astype("u1" if space.dtype == np.uint8 else "<f8").tobytes()


def play(env, steps, out):
    """Play with actions of the seeded action space; after an episode's end, start another one."""
    space = env.observation_space
    env.action_space.seed(SEED)
    draws = env.render_mode == "rgb_array"

    def write(observation, *numbers, frame):
        out.writelines(leaves(space, observation))
        out.write(np.array(numbers, "<f8").tobytes())
        if frame and draws:
            out.write(np.asarray(env.render(), "u1").tobytes())

    observation, _ = env.reset(seed=SEED)
    write(observation, frame=True)
    for step in range(1, steps + 1):
        observation, reward, terminated, truncated, _ = env.step(env.action_space.sample())
        write(observation, reward, terminated, truncated, frame=step % 10 == 0)
        if terminated or truncated:
            env.reset()


def make(env_id):
    """Make an environment as the server does by default."""
    env_class = gym.envs.registration.load_env_creator(gym.spec(env_id).entry_point)
    draws = "rgb_array" in env_class.metadata.get("render_modes", ())
    return gym.make(env_id, render_mode="rgb_array" if draws else None)


def main(directory):
    mujoco.choose_gl()
    for line in sys.stdin:
        name, env_id, steps = line.split()
        path = os.path.join(directory, name)
        try:
            env = make(env_id)
            with open(path + ".part", "wb") as out:
                play(env, int(steps), out)
            env.close()
        except Exception as error:
            with open(path + ".part", "w") as out:
                out.write(repr(error))
            path += ".failed"
        os.rename(os.path.join(directory, name + ".part"), path)


if __name__ == "__main__":
    main(sys.argv[1])
