import gymnasium
import numpy as np
import pytest
from environments import REGISTERED, family
from gymnasium.envs.registration import EnvSpec
from gymnasium.envs.toy_text.frozen_lake import FrozenLakeEnv, generate_random_map
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import RecordEpisodeStatistics

from gym_server.envs.config import Wrapper
from gym_server.envs.extras import is_available
from gym_server.rendering.render_thread import RenderThread
from gym_server.vector_envs.group import Group
from gym_server.vector_envs.sub_env import SubEnv

pytestmark = pytest.mark.slow

# Also without kwargs; by name without version.
KWARGS = {
    "Blackjack": [{"natural": True, "sab": False}],
    "CliffWalking": [{"is_slippery": True}, {"max_episode_steps": 7}],
    "FrozenLake": [
        {"is_slippery": False, "max_episode_steps": 7},
        {"map_name": "8x8", "max_episode_steps": -1},
        {"map_name": None, "desc": ["SFF", "FHF", "FFG"]},
    ],
    "Taxi": [{"is_rainy": True, "fickle_passenger": True}],
}
TOY_TEXT = [spec for spec in REGISTERED if family(spec) == "toy_text"]
JAX = [spec for spec in REGISTERED if family(spec) in ("phys2d", "tabular") and is_available(spec)]
CASES = [(spec.id, kwargs) for spec in TOY_TEXT for kwargs in [{}, *KWARGS.get(spec.name, [])]]


def sub_env(spec, render_mode=None, wrappers=(), **kwargs):
    return SubEnv(spec, render_mode, kwargs, wrappers, RenderThread())


def made_by(env_id, count=3, render_mode=None, wrappers=(), **kwargs):
    spec = gymnasium.spec(env_id) if isinstance(env_id, str) else env_id
    return list(sub_env(spec, render_mode, wrappers, **kwargs).make_all(count))


def made_new(env_id, count=3, **kwargs):
    return [gymnasium.make(env_id, disable_env_checker=True, **kwargs) for _ in range(count)]


def are_copies(envs):
    """Return whether they share a space, of which separate ones would have their own."""
    return all(env.action_space is envs[0].action_space for env in envs)


def play(envs, steps=60):
    """Return all results of playing some in turn, which would show shared state."""
    came = [env.reset(seed=seed) for seed, env in enumerate(envs)]
    rng = np.random.default_rng(0)
    for _ in range(steps):
        for env in envs:
            step = env.step(int(rng.integers(env.action_space.n)))
            came.append(step)
            if step[2] or step[3]:
                came.append(env.reset())
    return came


@pytest.mark.parametrize(("env_id", "kwargs"), CASES)
def test_copies_play_as_new_ones(env_id, kwargs):
    copies = made_by(env_id, **kwargs)
    assert are_copies(copies)
    np.testing.assert_equal(play(copies), play(made_new(env_id, **kwargs)))
    # Playing has changed nothing in the shared parts.
    np.testing.assert_equal(play(copies), play(made_new(env_id, **kwargs)))
    assert [str(env.spec) for env in copies] == [str(copies[0].spec)] * 3
    assert copies[0].spec == gymnasium.make(env_id, disable_env_checker=True, **kwargs).spec


@pytest.mark.parametrize("spec", TOY_TEXT, ids=lambda spec: spec.id)
def test_copies_without_seeds_are_independent(spec):
    copies = made_by(spec, 4)
    for env in copies:
        env.reset()
    assert len({env.unwrapped.np_random_seed for env in copies}) == 4
    assert len({id(env.unwrapped.np_random) for env in copies}) == 4


@pytest.mark.parametrize("spec", TOY_TEXT, ids=lambda spec: spec.id)
def test_each_copy_draws_its_own_state_until_it_is_closed(spec):
    pytest.importorskip("pygame")
    copies = made_by(spec, render_mode="rgb_array")
    new = made_new(spec.id, render_mode="rgb_array")
    assert are_copies(copies)
    for envs in (copies, new):
        play(envs, 5)
    wanted = [env.render() for env in new]
    np.testing.assert_equal([env.render() for env in copies], wanted)
    copies[0].close()
    np.testing.assert_equal([env.render() for env in copies[1:]], wanted[1:])
    np.testing.assert_equal(play(copies[1:], 5), play(made_new(spec.id, 2), 5))
    for env in (*copies, *new):
        env.close()


def test_a_group_of_copies_resets_each_with_its_seed():
    group = Group(sub_env(gymnasium.spec("Taxi-v4")), range(5), AutoresetMode.NEXT_STEP)
    assert are_copies(group.envs)
    observations, _ = group.reset(range(5), range(5), [None] * 5, None)
    new = gymnasium.make("Taxi-v4")
    assert observations.tolist() == [new.reset(seed=seed)[0] for seed in range(5)]


@pytest.mark.parametrize("spec", JAX, ids=lambda spec: spec.id)
def test_copies_share_what_jax_compiled_and_play_as_new_ones(spec):
    copies = made_by(spec)
    assert all(env.unwrapped.func_env is copies[0].unwrapped.func_env for env in copies)

    def play(env):
        env.action_space.seed(1)
        came = [env.reset(seed=5)[0]]
        for _ in range(20):
            step = env.step(env.action_space.sample())
            came += [step[0], step[1], step[2]]
            if step[2]:
                came.append(env.reset()[0])
        return [np.asarray(one).tolist() for one in came]

    first, *_, last = [play(env) for env in copies]
    assert first == last == play(made_new(spec.id, 1)[0])


@pytest.mark.parametrize("spec", JAX, ids=lambda spec: spec.id)
def test_copies_on_jax_without_seeds_are_independent(spec):
    generators = {str(env.unwrapped.rng) for env in made_by(spec, 4)}
    assert len(generators) == 4


# Environments that are not copied -------------------------------------------------------------


@pytest.mark.parametrize("kwargs", [{"map_name": None}, {"map_name": None, "desc": None}])
def test_each_random_map_is_another_one(kwargs):
    maps = {env.unwrapped.desc.tobytes() for env in made_by("FrozenLake-v1", 6, **kwargs)}
    assert len(maps) > 1


@pytest.mark.parametrize(
    "wrapper",
    [Wrapper("RecordEpisodeStatistics", {}), Wrapper("TimeLimit", {"max_episode_steps": 5})],
)
def test_what_the_client_wraps_is_made_anew(wrapper):
    assert not are_copies(made_by("FrozenLake-v1", wrappers=(wrapper,)))


def test_each_has_queues_of_its_own_in_the_wrappers_of_its_spec():
    spec = EnvSpec(
        "faultyCountedLake-v0",
        entry_point="gymnasium.envs.toy_text.frozen_lake:FrozenLakeEnv",
        additional_wrappers=(RecordEpisodeStatistics.wrapper_spec(),),
    )
    assert len({id(env.return_queue) for env in made_by(spec)}) == 3


@pytest.mark.parametrize("env_id", ["Acrobot-v1", "Pendulum-v1"])
def test_others_than_toy_text_are_made_anew(env_id):
    assert not are_copies(made_by(env_id))


def test_what_a_function_makes_is_made_anew():
    # A function may make another environment each time, like this one.
    spec = EnvSpec(
        "faultyRandomLake-v0", entry_point=lambda **_: FrozenLakeEnv(desc=generate_random_map())
    )
    assert len({env.unwrapped.desc.tobytes() for env in made_by(spec, 6)}) > 1


def test_a_group_of_different_spaces_is_refused_and_closed():
    closed = []

    class Larger(FrozenLakeEnv):
        sizes = iter([4, 4, 5])

        def __init__(self, **_):
            super().__init__(desc=generate_random_map(size=next(self.sizes)))

        def close(self):
            closed.append(self)

    makes = sub_env(EnvSpec("faultyLargerLake-v0", entry_point=Larger))
    with pytest.raises(RuntimeError, match=r"Discrete\(16\), another one Discrete\(25\)"):
        Group(makes, range(3), AutoresetMode.NEXT_STEP)
    assert len(closed) == 3
