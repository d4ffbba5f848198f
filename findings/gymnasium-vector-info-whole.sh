#!/usr/bin/env bash
# A vector environment of Gymnasium cuts the decimals off the numbers of an info, without a warning,
# if the first sub-environment that has them has a whole number there.
#
# Versions: gymnasium 1.4.0, numpy 2.4.6, Python 3.11.
# Expected: two sub-environments whose infos say 1 and 0.5 are told as 1 and 0.5, in either order.
# Seen: as 1 and 0, with SyncVectorEnv and AsyncVectorEnv. In the other order they are 0.5 and 1.
# Reason: VectorEnv._add_info() makes the array of a key by the type of its first value, and later
#   values are assigned to it.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet gymnasium==1.4.0 numpy==2.4.6
cat >"$folder/speeds.py" <<'EOF'
import gymnasium
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv


class Car(gymnasium.Env):
    """A car whose info tells a speed that never changes."""

    observation_space = action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, speed):
        self.speed = speed

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return 0, {"speed": self.speed}

    def step(self, action):
        return 0, 0.0, False, False, {"speed": self.speed}


def told(kind, *speeds):
    """Return the speeds that a vector environment tells after a step."""
    cars = kind([lambda speed=speed: Car(speed) for speed in speeds])
    cars.reset(seed=1)
    info = cars.step([0] * len(speeds))[4]
    cars.close()
    return info["speed"].tolist()


if __name__ == "__main__":
    for kind in (SyncVectorEnv, AsyncVectorEnv):
        print(f"{kind.__name__} of 1 and 0.5 tells {told(kind, 1, 0.5)}")
        print(f"{kind.__name__} of 0.5 and 1 tells {told(kind, 0.5, 1)}")
        assert told(kind, 1, 0.5) == [1, 0]
        assert told(kind, 0.5, 1) == [0.5, 1]
EOF
"$folder/venv/bin/python" "$folder/speeds.py"
echo "The behaviour is as described."
