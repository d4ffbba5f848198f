#!/usr/bin/env bash
# Atari's own vector environment has two options for lives. One begins a new game with each life,
# so no second life is ever played; the other tells of lost lives with a final_obs that is none.
#
# Versions: gymnasium 1.4.0, ale-py 0.12.1, numpy 2.4.6, Python 3.11.
# Expected: with episodic_life=True the loss of a life ends an episode, and the next one plays the
#   same game with the lives that are left, as with Stable-Baselines3's EpisodicLifeEnv. With
#   life_loss_info=True, in mode SameStep, final_obs has the pictures that the step ended with: its
#   first three are the last three of the step before.
# Seen: with episodic_life=True the number of lives is 5 again after each lost life of Breakout, and
#   episode_frame_number begins again. With life_loss_info=True the game goes on, but the first
#   three pictures of final_obs are not those of the step before, as they are at the end of a game;
#   those of the observation are.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet gymnasium==1.4.0 ale-py==0.12.1 numpy==2.4.6
"$folder/venv/bin/python" - <<'EOF'
import numpy as np
from ale_py.vector_env import AtariVectorEnv
from gymnasium.vector import AutoresetMode


def ends(**options):
    """Play Breakout at random; say of each end: lives, new game, pictures that go on."""
    env = AtariVectorEnv("breakout", 1, autoreset_mode=AutoresetMode.SAME_STEP, **options)
    before, info = env.reset(seed=1)
    frame = info["episode_frame_number"][0]
    draws = np.random.default_rng(1)
    found = []
    for _ in range(600):
        after, _, terminated, truncated, info = env.step(draws.integers(4, size=1))
        if terminated[0] or truncated[0]:
            new_game = bool(info["episode_frame_number"][0] < frame)
            final, shown = (np.array_equal(end[0][:3], before[0][1:])
                            for end in (info["final_obs"], after))
            found.append((int(info["lives"][0]), new_game, final, shown))
        before, frame = after, info["episode_frame_number"][0]
    return found


lives = ends(episodic_life=True)
print("episodic_life=True: lives, new game, final_obs goes on, observation goes on:", lives[:6])
assert len(lives) > 5
assert all(left == 5 and new_game for left, new_game, _, _ in lives)

told = ends(life_loss_info=True)
print("life_loss_info=True:", told[:6])
lost = [end for end in told if not end[1]]
assert len(lost) > 5
assert not any(final for _, _, final, _ in lost)
assert all(shown for _, _, _, shown in lost)
assert all(final for _, new_game, final, _ in told if new_game)
EOF
echo "The behaviour is as described."
