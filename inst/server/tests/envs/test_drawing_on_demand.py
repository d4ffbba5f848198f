import gymnasium
import numpy as np
import pytest

from gym_server.envs.drawing_on_demand import allow_drawing, save_drawing


def make(env_id, **how):
    return gymnasium.make(env_id, disable_env_checker=True, **how)


def test_lunar_lander_plays_the_same_game_and_draws_when_it_is_asked_to():
    pytest.importorskip("Box2D")
    drawing, saving = (make("LunarLander-v3", render_mode="rgb_array") for _ in range(2))
    mode = save_drawing(saving)
    assert (mode, saving.unwrapped.render_mode) == ("rgb_array", None)
    rng = np.random.default_rng(0)
    for seed in range(5):
        assert drawing.reset(seed=seed)[0].tobytes() == saving.reset(seed=seed)[0].tobytes()
        ended, sparks = False, 0
        while not ended:
            action = rng.integers(4)
            one, other = drawing.step(action), saving.step(action)
            assert one[0].tobytes() == other[0].tobytes()
            assert one[1:] == other[1:]
            sparks += len(drawing.unwrapped.particles)
            assert not saving.unwrapped.particles
            ended = one[2] or one[3]
        assert sparks > 0
    allow_drawing(saving, mode)
    saving.reset(seed=1)
    saving.step(2)
    assert saving.render().shape == (400, 600, 3)
    assert saving.unwrapped.particles
    for env in (drawing, saving):
        env.close()


def test_what_draws_in_each_step_and_what_does_not_mind_are_left_as_they_are():
    env = make("Acrobot-v1", render_mode="rgb_array")
    assert save_drawing(env) is None
    allow_drawing(env, None)
    assert env.unwrapped.render_mode == "rgb_array"
    env.close()
    pytest.importorskip("Box2D")
    lander = gymnasium.wrappers.AddRenderObservation(
        make("LunarLander-v3", render_mode="rgb_array")
    )
    assert save_drawing(lander) is None
    assert lander.unwrapped.render_mode == "rgb_array"
    lander.close()
