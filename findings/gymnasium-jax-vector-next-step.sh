#!/usr/bin/env bash
# In a JAX vector environment of Gymnasium (autoreset mode NEXT_STEP), the step that starts an
# episode in one sub-environment pays a reward there, and the other sub-environments do not move.
#
# Versions: gymnasium 1.4.0, jax 0.4.38, flax 0.10.4, numpy 2.4.6, Python 3.11.
# Expected: as with SyncVectorEnv and Gymnasium's other CartPole, the step that starts an episode
#   pays 0, and the others make their move.
# Seen: it pays 1. The others keep their state, so their actions are lost. They are paid for them
#   and may even be told that their episode ended, because both are calculated from the lost move.
# Reason: FunctionalJaxVectorEnv.step() replaces the next states of all by
#   `self.state.at[to_reset].set(new_initials)`, where self.state is the state before the move.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet gymnasium==1.4.0 jax==0.4.38 flax==0.10.4 numpy==2.4.6
"$folder/venv/bin/python" - <<'EOF'
import gymnasium
import numpy as np


def step_that_starts_an_episode(env_id):
    """Push left in sub-environment 0, alternate in 1; return the step after the first end."""
    env = gymnasium.make_vec(env_id, num_envs=2, vectorization_mode="vector_entry_point")
    env.reset(seed=1)
    ended, count = np.zeros(2, dtype=bool), 0
    while not ended.any():
        count += 1
        before, _, terminated, truncated, _ = env.step(np.array([0, count % 2]))
        before = np.array(before)
        ended = np.asarray(terminated) | np.asarray(truncated)
    assert ended.tolist() == [True, False]
    after, reward, *_ = env.step(np.array([0, 1]))
    moved = not np.array_equal(before[1], np.asarray(after)[1])
    print(f"{env_id}: rewards {np.asarray(reward).tolist()}, the other one moved: {moved}")
    return float(reward[0]), moved


assert step_that_starts_an_episode("CartPole-v1") == (0, True)
assert step_that_starts_an_episode("phys2d/CartPole-v1") == (1, False)
EOF
echo "The behaviour is as described."
