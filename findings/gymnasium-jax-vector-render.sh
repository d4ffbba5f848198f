#!/usr/bin/env bash
# A JAX vector environment of Gymnasium cannot be drawn, although it lists the mode rgb_array.
#
# Versions: gymnasium 1.4.0, jax 0.4.38, flax 0.10.4, numpy 2.4.6, pygame-ce 2.5.8, Python 3.11.
# Expected: render() returns a frame for each sub-environment, as Gymnasium's other CartPole does.
# Seen: with two and with four sub-environments render() raises "TypeError: Only scalar arrays can
#   be converted to Python scalars". The single environment phys2d/CartPole-v1 is drawn.
# Reason: CartPoleFunctional.render_image() takes the states of all for the state of one: x[0],
#   the position of the cart, is the whole state of the first sub-environment.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet gymnasium==1.4.0 jax==0.4.38 flax==0.10.4 numpy==2.4.6 \
  pygame-ce==2.5.8
SDL_VIDEODRIVER=dummy "$folder/venv/bin/python" - <<'EOF'
import gymnasium

single = gymnasium.make("phys2d/CartPole-v1", render_mode="rgb_array")
single.reset(seed=1)
print("single:", single.render().shape)

for num_envs in (2, 4):
    env = gymnasium.make_vec(
        "phys2d/CartPole-v1",
        num_envs=num_envs,
        vectorization_mode="vector_entry_point",
        render_mode="rgb_array",
    )
    env.reset(seed=1)
    assert "rgb_array" in env.metadata["render_modes"]
    try:
        env.render()
    except TypeError as error:
        print(f"{num_envs} sub-environments: TypeError: {error}")
    else:
        raise AssertionError("render() raises no TypeError")
EOF
echo "The behaviour is as described."
