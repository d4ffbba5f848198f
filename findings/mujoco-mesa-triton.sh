#!/usr/bin/env bash
# On a machine without a display, Python crashes when PyTorch makes an optimizer after a MuJoCo
# environment was drawn.
#
# Versions: gymnasium 1.4.0, mujoco 4.0.0, triton 3.9.0, numpy 2.4.6, Python 3.11; Mesa 22.3.6 with
#   LLVM 15 of Debian 12 (packages libegl1, libegl-mesa0, libgl1-mesa-dri).
# Expected: triton is imported, as it is when it comes first.
# Seen: the process ends with a segmentation fault (status 139) while it loads libtriton.so.
# Reason: Mesa's software renderer loads the system's LLVM for all libraries that come later, and
#   part of triton's own copy is bound to it. torch.optim imports triton, if it is installed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet \
  'gymnasium[mujoco]==1.4.0' mujoco==4.0.0 triton==3.9.0 numpy==2.4.6
cat >"$folder/draw.py" <<'EOF'
import sys

import gymnasium

if sys.argv[1] == "before":
    import triton
env = gymnasium.make("HalfCheetah-v5", render_mode="rgb_array")
env.reset()
env.render()
import triton
EOF
cd "$folder"
export MUJOCO_GL=egl
"$folder/venv/bin/python" draw.py before
status=0
"$folder/venv/bin/python" draw.py after || status=$?
echo "Imported after the picture, triton ends Python with status $status."
[ "$status" = 139 ]
echo "The behaviour is as described."
