"""The measurement for choosing the number of processes."""

import gymnasium
import pytest

from gym_server.envs.config import EnvConfig
from gym_server.envs.memory_reservation import MemoryReservation
from gym_server.rendering.render_thread import RenderThread
from gym_server.vector_envs import num_workers
from gym_server.vector_envs.sub_env import SubEnv


@pytest.fixture
def choose(monkeypatch):
    """Choose for an environment whose steps must be measured."""

    def choose(**kwargs):
        config = EnvConfig("", kwargs=kwargs, num_envs=64, max_workers=4)
        sub_env = SubEnv(spec, None, kwargs, (), renderer, MemoryReservation())
        return num_workers.choose_num_workers(config, spec, sub_env, renderer)

    monkeypatch.setattr(num_workers, "usable_cores", lambda: 4)
    monkeypatch.setattr(num_workers, "_measured", {})
    spec, renderer = gymnasium.spec("Counting-v0"), RenderThread()
    yield choose
    renderer.stop()


def test_what_is_measured_is_remembered_for_so_many_only(choose, monkeypatch):
    monkeypatch.setattr(num_workers, "_MOST_MEASURED", 3)
    for length in range(1, 6):
        choose(length=length)
    assert len(num_workers._measured) == 3
    made = []
    monkeypatch.setattr(num_workers, "_measure", lambda *_: made.append(1) or 0.0)
    choose(length=5)
    assert not made
    choose(length=1)
    assert made
