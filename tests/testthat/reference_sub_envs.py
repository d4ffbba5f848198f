"""Play a vector environment in process and write the results to a file, for the R tests.

Usage: reference_sub_envs.py ENV_ID NUM_ENVS MODE AUTORESET STEPS FILE < ACTIONS. MODE is
"vector_entry_point" or "sync", AUTORESET a value of Gymnasium's AutoresetMode, and ACTIONS has a
line of numbers per step, one per sub-environment. The file has the observation of the reset with
seed 7, then for each step observation, reward, terminated, truncated and the observation that the
step led to, which may be the last of an episode that was reset in the same step. The order is by
sub-environment, the format little-endian doubles.
"""

import sys

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode

SEED = 7


def main(env_id, num_envs, mode, autoreset, steps, path):
    more = {} if mode == "vector_entry_point" else {"autoreset_mode": AutoresetMode(autoreset)}
    env = gym.make_vec(env_id, int(num_envs), vectorization_mode=mode, vector_kwargs=more)
    with open(path, "wb") as out:
        observation, _ = env.reset(seed=SEED)
        out.write(np.asarray(observation, "<f8").tobytes())
        for _ in range(int(steps)):
            action = np.array(sys.stdin.readline().split(), env.action_space.dtype)
            *parts, info = env.step(action.reshape(env.action_space.shape))
            next_observation = np.array(parts[0])
            for ended in np.flatnonzero(info.get("_final_obs", [])):
                next_observation[ended] = info["final_obs"][ended]
            for part in [*parts, next_observation]:
                out.write(np.asarray(part, "<f8").tobytes())
    env.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
