import os
import signal
import subprocess
import sys
import time

import faulty_envs  # noqa: F401 - it registers what is made here
import gymnasium
import numpy as np
import pytest
from conftest import SERVER
from gymnasium.vector import AutoresetMode
from running import descendants, is_running

from gym_server.envs.vector_envs import AsyncSubEnvs, SubEnv
from gym_server.rendering.render_thread import RenderThread


def sub_env(name="Uneven", **kwargs):
    return SubEnv(gymnasium.spec(f"{name}-v0"), None, kwargs, (), RenderThread())


@pytest.fixture
def processes():
    """Make sub-environments in processes; they are gone when the test is over."""
    made = []

    def processes(name="Uneven", mode=AutoresetMode.NEXT_STEP, **kwargs):
        made.append(AsyncSubEnvs(sub_env(name, **kwargs), 3, mode))
        return made[-1]

    yield processes
    for env in made:
        env.close()


def zeros(env):
    return np.zeros(env.action_space.shape, env.action_space.dtype)


def test_a_failure_in_a_sub_env_is_told_and_the_other_processes_end(processes):
    env = processes("SpoilsOneSubEnv", space="Discrete", longest=1)
    env.reset(seed=1)
    pids = [process.pid for process in env.processes]
    with pytest.raises(ValueError, match="too long"):
        env.step(zeros(env))
    with pytest.raises(RuntimeError, match="close it and create another"):
        env.reset(seed=1)
    env.close()
    assert not any(map(is_running, pids))


def test_a_failure_that_cannot_be_sent_is_told_as_such(processes, monkeypatch):
    monkeypatch.setattr("gym_server.envs.vector_envs._ERROR_SECONDS", 0.5)
    env = processes("CannotSaySo")
    env.reset(seed=1)
    with pytest.raises(RuntimeError, match="could not send why"):
        env.step(zeros(env))


@pytest.mark.parametrize("how", ["itself", "killed"])
def test_a_process_that_ends_is_told_by_its_sub_env(processes, how):
    env = processes("KillsItself" if how == "itself" else "Uneven")
    env.reset(seed=1)
    if how == "killed":
        env.processes[1].kill()
    words = (
        "sub-environment 1 ended" if how == "killed" else "the process of sub-environment . ended"
    )
    with pytest.raises(RuntimeError, match=words):
        for _ in range(3):
            env.step(zeros(env))


def test_closing_does_not_wait_for_a_process_that_hangs(processes, monkeypatch):
    monkeypatch.setattr("gym_server.envs.vector_envs._CLOSE_SECONDS", 0.3)
    env = processes("Hanging")
    env.reset(seed=1)
    env.step_async(np.zeros(3, np.int64))
    pids = [process.pid for process in env.processes]
    began = time.monotonic()
    env.close()
    assert time.monotonic() - began < 5
    assert not any(map(is_running, pids))


def test_a_signal_to_the_server_is_none_to_its_sub_envs(processes):
    # A forked process would have the server's own handlers.
    env = processes()
    assert all("forkserver" in repr(type(process)).lower() or os.name == "nt"
               for process in env.processes)  # fmt: skip


_DIES = """
import os, sys, time
from gym_server.rendering.render_thread import RenderThread
from gym_server.envs.vector_envs import AsyncSubEnvs, SubEnv
from gymnasium.vector import AutoresetMode
import gymnasium, faulty_envs, numpy
if __name__ == "__main__":
    sub_env = SubEnv(gymnasium.spec("Hanging-v0"), None, {}, (), RenderThread())
    env = AsyncSubEnvs(sub_env, 2, AutoresetMode.NEXT_STEP)
    env.reset()
    env.step_async(numpy.zeros(2, numpy.int64))
    print(*[process.pid for process in env.processes], flush=True)
    time.sleep(60)
"""


def test_sub_envs_end_with_a_server_that_is_killed(tmp_path, eventually):
    script = tmp_path / "dies.py"
    script.write_text(_DIES)
    variables = {**os.environ, "PYTHONPATH": f"{SERVER}{os.pathsep}{SERVER / 'tests'}"}
    with subprocess.Popen(
        [sys.executable, script], stdout=subprocess.PIPE, text=True, env=variables
    ) as server:
        pids = [int(pid) for pid in server.stdout.readline().split()]
        assert len(pids) == 2
        server.send_signal(signal.SIGKILL)
    eventually(lambda: not any(map(is_running, pids)))


def test_a_server_that_stops_ends_its_sub_envs(serve, eventually):
    server = serve()
    url = server.create("faulty_envs:Uneven-v0", num_envs=2, vectorization_mode="async")
    assert server.post(f"{url}/reset/")[0] == 200
    children = descendants(server.process.pid)
    assert len(children) >= 2
    status, _, errors = server.stop()
    assert (status, errors) == (0, "")
    eventually(lambda: not any(map(is_running, children)))


@pytest.mark.slow
def test_a_step_that_hangs_in_a_process_does_not_keep_the_server(serve, eventually):
    server = serve()
    url = server.create("faulty_envs:Hanging-v0", num_envs=2, vectorization_mode="async")
    server.post(f"{url}/reset/")
    children = descendants(server.process.pid)
    with server.socket() as connection:
        body = b'{"action": [0, 0]}'
        connection.sendall(
            b"POST %b/step/ HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: %d\r\n\r\n%b"
            % (url.encode(), len(body), body)
        )
        time.sleep(0.5)
        assert server.stop(timeout=40)[0] == 0
    eventually(lambda: not any(map(is_running, children)))
