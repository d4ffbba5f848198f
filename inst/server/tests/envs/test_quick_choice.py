"""Cards are drawn quickly, and are the same as Gymnasium's."""

import gymnasium
import numpy as np
import pytest

from gym_server.envs.quick_choice import QuickChoice, choose_quickly


def test_a_list_is_chosen_from_as_numpy_does():
    ours, numpys = QuickChoice(np.random.PCG64(3)), np.random.Generator(np.random.PCG64(3))
    for length in (1, 2, 13, 1000):
        items = list(range(length))
        assert [ours.choice(items) for _ in range(100)] == [
            numpys.choice(items) for _ in range(100)
        ]
    # All other calls use NumPy.
    assert ours.choice([1, 2, 3], 5).tolist() == numpys.choice([1, 2, 3], 5).tolist()
    assert ours.choice([1, 2], p=[0.9, 0.1]) == numpys.choice([1, 2], p=[0.9, 0.1])
    assert ours.choice(7) == numpys.choice(7)


@pytest.mark.parametrize("settings", [{}, {"sab": True}, {"natural": True}])
def test_blackjack_deals_the_cards_of_its_seed(settings):
    def episodes(env):
        for seed in [*range(200), None, None]:
            observation, info = env.reset(seed=seed)
            told = [observation, info, str(env.unwrapped.dealer_top_card_suit)]
            ended = False
            while not ended:
                observation, reward, ended, *others = env.step(int(observation[0] < 17))
                told += [observation, reward, ended, others]
            yield told

    quick = gymnasium.make("Blackjack-v1", **settings)
    choose_quickly(quick)
    assert list(episodes(quick)) == list(episodes(gymnasium.make("Blackjack-v1", **settings)))
    assert type(quick.unwrapped.np_random) is QuickChoice


def test_other_environments_are_left_alone():
    env = gymnasium.make("CliffWalking-v1")
    choose_quickly(env)
    env.reset(seed=1)
    assert type(env.unwrapped.np_random) is np.random.Generator
