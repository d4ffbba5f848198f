"""Memory is estimated before it is used, for all environments together."""

import tracemalloc

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.envs.classic_control.cartpole import CartPoleVectorEnv

from gym_server.api.app import Config, create_app
from gym_server.budget import Budget
from gym_server.envs import make
from gym_server.envs.config import EnvConfig, Wrapper
from gym_server.envs.memory_estimate import model_bytes, observation_bytes
from gym_server.envs.memory_reservation import MemoryReservation
from gym_server.envs.transition_model import transition_model
from gym_server.envs.wrappers import wrap
from gym_server.errors import GymServerError
from gym_server.manager.limits import Limits
from gym_server.protocol.answers import dumps
from gym_server.rendering.render_thread import RenderThread

pytestmark = pytest.mark.slow

MB = 2**20


@pytest.fixture
def limited():
    """Return a client of an application with a memory limit in MiB."""
    apps = []

    def limited(max_memory_mb=Limits.max_memory_mb):
        limits = Limits(max_memory_mb=max_memory_mb)
        apps.append(create_app(Config(allowed_modules=["faulty_envs"], limits=limits)))
        return apps[-1].test_client()

    yield limited
    for app in apps:
        app.close()


def create(client, env_id="CartPole-v1", **fields):
    return client.post("/v1/envs/", json={"env_id": env_id, **fields})


def stacks(*sizes):
    return [{"name": "FrameStackObservation", "kwargs": {"stack_size": size}} for size in sizes]


def refused(answer):
    return (answer.status_code, answer.json["code"]) == (429, "too_much_memory")


@pytest.fixture
def nothing_large(monkeypatch):
    """Fail if a space of more than 64 MB is made."""
    make_box = spaces.Box.__init__

    def small(self, low, high, shape=None, dtype=np.float32, **how):
        size = max(np.prod(shape or ()), np.size(low)) * np.dtype(dtype).itemsize
        assert size < 64 * MB, f"a Box of {size / MB} MB was made"
        make_box(self, low, high, shape, dtype, **how)

    monkeypatch.setattr(spaces.Box, "__init__", small)


@pytest.mark.parametrize(
    "wrappers",
    [
        stacks(1000, 1000, 40),
        stacks(1000, 100, 1000, 1000, 1000),
        [*stacks(1000, 500), {"name": "DelayObservation", "kwargs": {"delay": 1000}}],
        [
            {"name": "AddRenderObservation"},
            {"name": "ResizeObservation", "kwargs": {"shape": [4096, 4096]}},
            *stacks(100),
        ],
        [{"name": "AddRenderObservation"}, *stacks(1000)],
        [
            {"name": "AddRenderObservation"},
            {"name": "DiscretizeObservation", "kwargs": {"bins": 10_000}},
        ],
    ],
    ids=lambda wrappers: "-".join(wrapper["name"][:12] for wrapper in wrappers),
)
@pytest.mark.parametrize("num_envs", [None, 2])
def test_nested_wrappers_are_refused_before_they_take_memory(
    limited, nothing_large, wrappers, num_envs
):
    client = limited()
    answer = create(client, wrappers=wrappers, num_envs=num_envs)
    assert refused(answer), answer.json
    assert any(wrapper["name"] in answer.json["message"] for wrapper in wrappers)
    assert "4,096 MiB for all environments together" in answer.json["message"]
    assert "--max-memory-mb" in answer.json["hint"]
    # All memory was returned to the budget.
    assert client.application._instances._budget.left == 4096 * MB


@pytest.mark.parametrize(("num_envs", "most"), [(None, 200), (2, 400)])
def test_what_discretizing_multiplies_is_refused_before_it_is_flattened(limited, num_envs, most):
    # Small pictures and little memory: discretizing each number of a picture takes time.
    wrappers = [
        {"name": "AddRenderObservation"},
        {"name": "ResizeObservation", "kwargs": {"shape": [110, 110]}},
        {"name": "DiscretizeObservation", "kwargs": {"bins": 255, "multidiscrete": True}},
        {"name": "FlattenObservation"},
    ]
    answer = create(limited(most), wrappers=wrappers, num_envs=num_envs)
    assert refused(answer), answer.json
    assert "FlattenObservation" in answer.json["message"]


def test_atari_stacks_of_its_own_are_estimated(limited):
    pytest.importorskip("ale_py")
    kwargs = {"stack_num": 64, "img_height": 1024, "img_width": 1024, "grayscale": False}
    how = {"num_envs": 64, "vectorization_mode": "vector_entry_point"}
    assert refused(create(limited(), "ALE/Pong-v5", kwargs=kwargs, **how))


@pytest.mark.parametrize("how", [{}, {"num_envs": 1, "vectorization_mode": "sync"}])
def test_a_picture_that_cannot_fit_is_refused_before_it_is_drawn(limited, how):
    client = limited(max_memory_mb=256)
    # Drawing it takes 1.1 GiB.
    large = create(client, "HalfCheetah-v5", kwargs={"width": 4096, "height": 4096}, **how)
    assert refused(large), large.json
    usual = create(client, "HalfCheetah-v5", **how)
    assert usual.status_code == 200 or usual.json["code"] == "missing_dependency"


def test_sub_environments_count(limited):
    client = limited()
    # 600 x 400 x 3 bytes, which are sent as small integers.
    pictures = [{"name": "AddRenderObservation"}]
    assert create(client, wrappers=pictures, num_envs=2).status_code == 200
    assert refused(create(client, wrappers=pictures, num_envs=1024))
    assert refused(create(client, "Taxi-v4", num_envs=16_384))


def test_what_all_have_together_counts_until_it_is_closed(limited):
    client = limited(max_memory_mb=70)
    first = create(client, wrappers=stacks(1000, 100), num_envs=1)
    assert first.status_code == 200, first.json
    assert refused(create(client, wrappers=stacks(1000, 100), num_envs=1))
    assert create(client).status_code == 200
    client.post(f"/v1/envs/{first.json['instance_id']}/close/")
    assert create(client, wrappers=stacks(1000, 100), num_envs=1).status_code == 200


def test_a_vector_implementation_that_was_tried_in_vain_is_not_counted(limited):
    client = limited()
    budget = client.application._instances._budget
    made = create(client, num_envs=8, vectorization_mode="sync").json["instance_id"]
    alone = budget.left
    client.post(f"/v1/envs/{made}/close/")
    # CartPole's own implementation supports only resets in the next step.
    create(client, num_envs=8, autoreset_mode="SameStep")
    assert budget.left == alone


@pytest.mark.parametrize(
    ("env_id", "num_envs", "wrappers"),
    [
        ("CartPole-v1", 16_384, []),
        ("MountainCar-v0", 4_096, stacks(4)),
        ("CartPole-v1", 16, [{"name": "AddRenderObservation"}, *stacks(4)]),
        (
            "ALE/Pong-v5",
            64,
            [{"name": "AtariPreprocessing", "kwargs": {"frame_skip": 1}}, *stacks(4)],
        ),
        ("ALE/Pong-v5", 16, stacks(4)),
        ("Humanoid-v5", 64, [{"name": "NormalizeObservation"}]),
        ("FrozenLake8x8-v1", 4_096, [{"name": "FlattenObservation"}]),
    ],
    ids=lambda value: str(value)[:20],
)
def test_what_people_do_is_within_the_default(env_id, num_envs, wrappers):
    memory = MemoryReservation(Budget(Limits.max_memory_mb * MB), num_envs)
    chosen = [Wrapper(one["name"], one.get("kwargs", {})) for one in wrappers]
    renderer = RenderThread()
    env = make.make_env(EnvConfig(env_id, wrappers=tuple(chosen)), (), memory)
    wrap(env, chosen, renderer, memory)
    renderer.stop()
    assert memory.taken < Limits.max_memory_mb * MB


@pytest.mark.parametrize(
    ("env_id", "kwargs"),
    [
        ("FrozenLake-v1", {"desc": ["S" + 29 * "F", *(28 * [30 * "F"]), 29 * "F" + "G"]}),
        ("FrozenLake-v1", {}),
        ("CliffWalking-v1", {}),
        ("Taxi-v4", {}),
        ("Taxi-v4", {"is_rainy": True}),
    ],
)
def test_a_transition_model_takes_no_more_than_is_estimated(env_id, kwargs):
    env = gymnasium.make(env_id, **kwargs)
    tracemalloc.start()
    dumps({"model": transition_model(env, env_id)})
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most <= model_bytes(env) < 3 * most


def test_a_transition_model_is_paid_for_in_advance(limited):
    client = limited(max_memory_mb=1)
    assert create(client, "FrozenLake-v1").status_code == 200
    answer = create(client, "FrozenLake-v1", kwargs={"desc": ["S" + 119 * "F", 119 * "F" + "G"]})
    assert refused(answer)
    assert answer.json["message"].startswith("Its transition model would bring")


def test_what_is_taken_is_at_most_what_there_is():
    budget = Budget(10)
    assert budget.take(10)
    assert not budget.take(1)
    assert not budget.take(float("inf"))
    assert not budget.take(float("nan"))
    budget.give_back(10)
    assert budget.left == 10


def test_a_reservation_gives_back_what_it_took():
    budget = Budget(100)
    memory = MemoryReservation(budget, 4)
    memory.reserve(20, "It")
    with pytest.raises(GymServerError):
        memory.reserve(6, "It")
    assert budget.left == 20
    memory.give_back()
    assert budget.left == 100


@pytest.mark.parametrize(
    "space",
    [
        spaces.Box(0, 1, (3, 4), np.float64),
        spaces.Discrete(7),
        spaces.MultiDiscrete([3, 4]),
        spaces.MultiBinary((2, 3)),
        spaces.Tuple([spaces.Box(0, 1, (2,)), spaces.Dict({"a": spaces.Discrete(3)})]),
    ],
)
def test_an_observation_has_the_bytes_that_numpy_counts(space):
    def count(sample):
        if isinstance(sample, (tuple, dict)):
            parts = sample.values() if isinstance(sample, dict) else sample
            return sum(map(count, parts))
        return np.asarray(sample).nbytes

    assert observation_bytes(space) == count(space.sample())


@pytest.mark.parametrize("kind", ["Letters-v0", "Nested-v0", "Deep-v0"])
def test_every_space_can_be_estimated(kind):
    import faulty_envs  # noqa: F401

    kwargs = {"depth": 50} if kind == "Deep-v0" else {}
    assert observation_bytes(gymnasium.make(kind, **kwargs).observation_space) > 0


def test_a_vector_environment_that_is_refused_is_closed(limited, monkeypatch):
    closed = []
    monkeypatch.setattr(CartPoleVectorEnv, "close", lambda env, **_: closed.append(env))
    monkeypatch.setattr("gym_server.vector_envs.make_vec.answer_bytes", lambda space: np.inf)
    answer = create(limited(), num_envs=2)
    assert (answer.status_code, answer.json["code"]) == (429, "too_much_memory")
    assert len(closed) == 1
