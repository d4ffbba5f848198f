import os
import signal
from types import SimpleNamespace

import gymnasium
import pytest
from gymnasium.vector import AutoresetMode
from running import is_running

from gym_server.processes.pool import Pool
from gym_server.rendering.render_thread import RenderThread
from gym_server.vector_envs.sub_env import SubEnv
from gym_server.vector_envs.sub_envs import SubEnvs

GROUPS = "gym_server.vector_envs.group_worker"


@pytest.fixture
def warm(monkeypatch):
    def warm(**how):
        made.append(Pool(**how))
        for user in ("vector_envs.sub_envs", "manager.instance_manager"):
            monkeypatch.setattr(f"gym_server.{user}.pool", made[-1])
        return made[-1]

    made = []
    yield warm
    for one in made:
        one.end()


def make(keeps_processes=True, env_id="Acrobot-v1", num_workers=2):
    spec = gymnasium.spec(env_id)
    sub_env = SubEnv(spec, None, {}, (), RenderThread())
    return SubEnvs(
        sub_env, 4, AutoresetMode.SAME_STEP, num_workers, RenderThread(), keeps_processes
    )


def test_a_process_runs_one_group_after_the_other(warm):
    warm(most=2)
    first = make()
    pids = first.pids
    start, _ = first.reset(3, None, None)
    first.close()
    second = make(env_id="Pendulum-v1")
    assert sorted(second.pids) == sorted(pids)
    assert second.reset(3, None, None)[0].shape == (4, 3)
    second.close()
    third = make()
    assert sorted(third.pids) == sorted(pids)
    assert third.reset(3, None, None)[0].tolist() == start.tolist()
    third.close()


def test_no_more_than_so_many_are_kept(warm, eventually):
    warm(most=1)
    env = make()
    pids = env.pids
    env.close()
    eventually(lambda: sum(map(is_running, pids)) == 1)


def test_what_others_must_not_get_is_not_kept(warm, eventually):
    warm(most=2)
    env = make(keeps_processes=False)
    pids = env.pids
    env.close()
    eventually(lambda: not any(map(is_running, pids)))


def test_each_ends_after_a_while(warm, monkeypatch, eventually):
    pool = warm(most=2)
    now = 0.0
    clock = SimpleNamespace(monotonic=lambda: now)
    monkeypatch.setattr("gym_server.processes.pool.time", clock)
    first, second = pool.take(GROUPS), pool.take(GROUPS)
    pool.put(first)
    now = 500.0
    pool.put(second)
    now = 700.0
    pool.end_old()
    eventually(lambda: not is_running(first.pid))
    assert is_running(second.pid)


def test_one_that_has_ended_takes_no_place(warm, eventually):
    pool = warm(most=1)
    first, second = pool.take(GROUPS), pool.take(GROUPS)
    pool.put(first)
    os.kill(first.pid, signal.SIGKILL)
    eventually(lambda: not first.is_alive)
    pool.put(second)
    assert is_running(second.pid)
    assert pool.take(GROUPS) is second
    second.kill()


def test_the_end_of_a_server_ends_them(warm, quick, eventually):
    pool = warm(most=1)
    app = quick()
    process = pool.take(GROUPS)
    pool.put(process)
    app.close()
    eventually(lambda: not is_running(process.pid))


def test_one_that_has_ended_is_not_given_out(warm, eventually):
    pool = warm(most=2)
    env = make()
    pids = env.pids
    env.close()
    os.kill(pids[0], signal.SIGKILL)
    eventually(lambda: not is_running(pids[0]))
    eventually(lambda: sum(process.is_alive for _, process in pool._idle) == 1)
    another = make()
    assert pids[0] not in another.pids
    assert another.reset(1, None, None)[0].shape == (4, 6)
    another.close()
