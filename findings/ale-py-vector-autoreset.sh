#!/usr/bin/env bash
# Atari's own vector environment sends final_obs without its mask, and refuses the autoreset mode
# Disabled, for which its reset_mask is made.
#
# Versions: gymnasium 1.4.0, ale-py 0.12.1, numpy 2.4.6, Python 3.11.
# Expected: in mode SameStep the info has _final_obs beside final_obs, a logical value for each
#   sub-environment, as Gymnasium's vector environments send it. Every AutoresetMode can be chosen,
#   as the signature says.
# Seen: the info has final_obs with a row for every sub-environment, also for those whose episode
#   goes on, and no _final_obs. With AutoresetMode.DISABLED make_vec() raises
#   "ValueError: Invalid autoreset_mode: Disabled".
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet gymnasium==1.4.0 ale-py==0.12.1 numpy==2.4.6
"$folder/venv/bin/python" - <<'EOF'
import ale_py
import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

gymnasium.register_envs(ale_py)


def make(autoreset_mode):
    """Make two games of Pong that end after about ten steps."""
    return gymnasium.make_vec(
        "ALE/Pong-v5",
        num_envs=2,
        vectorization_mode="vector_entry_point",
        autoreset_mode=autoreset_mode,
        max_num_frames_per_episode=40,
    )


env = make(AutoresetMode.SAME_STEP)
env.reset(seed=1)
env.step(np.array([0, 0]))
# The second one starts again, so that the first ends before it.
env.reset(options={"reset_mask": np.array([False, True])})
ended = np.zeros(2, dtype=bool)
while not ended.any():
    _, _, terminated, truncated, info = env.step(np.array([0, 0]))
    ended = terminated | truncated
print("ended:", ended.tolist(), "info:", {name: value.shape for name, value in info.items()})
assert ended.tolist() == [True, False]
assert info["final_obs"].shape[0] == 2
assert "_final_obs" not in info

try:
    make(AutoresetMode.DISABLED)
except ValueError as error:
    print("Disabled:", error)
    assert str(error) == "Invalid autoreset_mode: Disabled"
else:
    raise AssertionError("the mode Disabled is not refused")
EOF
echo "The behaviour is as described."
