#!/usr/bin/env bash
# A JAX vector environment of Gymnasium remembers over reset(seed=) which episodes had ended.
#
# Versions: gymnasium 1.4.0, jax 0.4.38, flax 0.10.4, numpy 2.4.6, Python 3.11.
# Expected: two plays from the same seed are the same, as with Gymnasium's SyncVectorEnv.
# Seen: the first step after the second reset() starts the episode once more, from another state.
#   It counts for no limit, so an episode has 4 steps under a limit of 3 (501 under 500).
# Reason: FunctionalJaxVectorEnv.reset() does not clear its attribute prev_done.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet gymnasium==1.4.0 jax==0.4.38 flax==0.10.4 numpy==2.4.6
"$folder/venv/bin/python" - <<'EOF'
import gymnasium
import numpy as np

env = gymnasium.make_vec(
    "phys2d/CartPole-v1", num_envs=1, vectorization_mode="vector_entry_point", max_episode_steps=3
)


def play():
    """Return the observations of one episode from seed 1, always with action 0."""
    observation, _ = env.reset(seed=1)
    observations, ended = [observation], False
    while not ended:
        observation, _, terminated, truncated, _ = env.step(np.array([0]))
        observations.append(observation)
        ended = bool(terminated[0] or truncated[0])
    return [np.round(np.asarray(observation[0]), 3).tolist() for observation in observations]


first, second = play(), play()
for name, observations in {"first": first, "second": second}.items():
    print(f"The {name} play has {len(observations) - 1} steps under a limit of 3:")
    print(*observations, sep="\n")

assert len(first) - 1 == 3
assert len(second) - 1 == 4
assert first[0] == second[0] and first[1] != second[1]
EOF
echo "The behaviour is as described."
