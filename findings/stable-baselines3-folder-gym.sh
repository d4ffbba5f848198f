#!/usr/bin/env bash
# Stable-Baselines3 cannot save a model if a folder called gym lies beside the script, even an empty
# one: such as a folder of notes, or a checkout of a package of that name.
#
# Versions: stable-baselines3 2.9.2, torch 2.15.0, gymnasium 1.4.0, numpy 2.4.6, Python 3.11.
#   On Linux this downloads three gigabytes.
# Expected: model.save() writes its file.
# Seen: AttributeError: module 'gym' has no attribute '__version__'. Training works until then, so
#   what was trained is lost. Without the folder the file is written.
# Reason: save() adds a list of versions. get_system_info() imports gym to tell the version of the
#   old OpenAI Gym, and takes any folder of that name for it.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet \
  stable-baselines3==2.9.2 torch==2.15.0 gymnasium==1.4.0 numpy==2.4.6
mkdir "$folder/work"
cat >"$folder/work/train.py" <<'EOF'
from stable_baselines3 import PPO

model = PPO("MlpPolicy", "CartPole-v1", n_steps=8, batch_size=8, device="cpu")
model.learn(8)
try:
    model.save("model.zip")
    print("saved")
except AttributeError as error:
    print(error)
EOF
cd "$folder/work"
without=$("$folder/venv/bin/python" train.py)
mkdir gym
with=$("$folder/venv/bin/python" train.py)
printf 'Without the folder: %s\nWith it: %s\n' "$without" "$with"
[ "$without" = "saved" ]
[ "$with" = "module 'gym' has no attribute '__version__'" ]
echo "The behaviour is as described."
