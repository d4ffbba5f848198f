import os
import signal
import subprocess
import sys

import faulty_envs  # noqa: F401 - it registers what is made here
import gymnasium
import numpy as np
import pytest
from conftest import SERVER, SHORT_GRACE
from gymnasium.vector import AutoresetMode
from running import descendants, is_running
from vector_play import MODES_SLOWLY, actions_of

from gym_server.errors import GymServerError
from gym_server.processes.pool import Pool
from gym_server.rendering.render_thread import RenderThread
from gym_server.spaces.stacking import stack
from gym_server.vector_envs.sub_env import SubEnv
from gym_server.vector_envs.sub_envs import SubEnvs

pytestmark = pytest.mark.slow


@pytest.fixture
def make():
    """Make sub-environments, by default three in separate processes; close them after the test."""
    made = []

    def make(name="Uneven", num_envs=3, num_workers=3, mode="NextStep", keep=False, **kwargs):
        spec = gymnasium.spec(f"{name}-v0")
        sub_env = SubEnv(spec, None, kwargs, (), RenderThread())
        mode = AutoresetMode(mode)
        made.append(SubEnvs(sub_env, num_envs, mode, num_workers, RenderThread(), keep))
        return made[-1]

    yield make
    for env in made:
        env.close()


def zeros(env):
    return np.zeros(env.action_space.shape, env.action_space.dtype)


def frozen(value):
    """Return a value with comparable parts, including the bytes of its arrays."""
    if isinstance(value, np.ndarray):
        data = value.tolist() if value.dtype == object else value.tobytes()
        return (value.dtype.str, value.shape, frozen(data))
    if isinstance(value, dict):
        return {key: frozen(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [frozen(item) for item in value]
    return value


def play(env, steps, seed=7, mode="NextStep", with_infos=True):
    """Return the results of some steps, of all sub-environments and of some."""
    came = [env.reset(seed, None, None, with_infos)]
    rng = np.random.default_rng(0)
    waiting = np.zeros(env.num_envs, dtype=bool)
    for step in range(steps):
        which = np.flatnonzero(~waiting & (rng.random(env.num_envs) < (1 if step % 3 else 0.6)))
        if not len(which):
            came.append(env.reset(None, None, waiting, with_infos))
            waiting[:] = False
            continue
        actions, _ = actions_of(env, step)
        batch = stack(env.single_action_space, [actions[index] for index in which])
        came.append(env.step(which, batch, with_infos))
        if mode == "Disabled":
            waiting[which] = came[-1][2] | came[-1][3]
            assert env.ended.tolist() == waiting.tolist()
    return frozen(came)


@pytest.fixture(scope="module")
def kept_processes():
    """Keep the processes of one test for the next."""
    pool = Pool(most=5)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gym_server.vector_envs.sub_envs.pool", pool)
        yield
    pool.end()


@pytest.mark.parametrize("mode", MODES_SLOWLY)
@pytest.mark.parametrize("space", ["Box", "Discrete", "Dict", "Tuple", "Text", "Sequence", "Graph"])
def test_any_number_of_processes_gives_the_same_bytes(make, kept_processes, space, mode):
    def came_of(num_workers):
        how = {"mode": mode, "space": space, "longest": 4}
        env = make(num_envs=5, num_workers=num_workers, keep=True, **how)
        came = play(env, 15, mode=mode)
        env.close()
        return came

    # None; some with more sub-environments than others; one for each.
    came = [came_of(num_workers) for num_workers in (0, 2, 5)]
    assert all(one == came[0] for one in came)


def test_without_infos_only_last_observations_come(make):
    told = play(make(num_workers=0, mode="SameStep", longest=3), 12)
    silent = play(make(num_workers=2, mode="SameStep", longest=3), 12, with_infos=False)
    finals = 0
    for one, other in zip(told, silent, strict=True):
        assert one[:-1] == other[:-1]
        assert set(other[-1]) <= {"final_obs", "_final_obs"}
        finals += len(other[-1])
        for key, value in other[-1].items():
            assert one[-1][key] == value
    assert finals > 0


@pytest.mark.parametrize("num_workers", [0, 2])
@pytest.mark.parametrize("mode", ["SameStep", "NextStep"])
def test_episodes_begin_with_the_seeds_that_were_given(make, mode, num_workers):
    seeds = [(11, 12, 13), (21,), (31, 32)]
    env = make(num_envs=3, num_workers=num_workers, mode=mode)
    alone = make(num_envs=1, num_workers=0, mode="Disabled")
    played = {seed: [] for own in seeds for seed in own}
    current = list(range(3))
    observation, _ = env.reset(seeds, None, None)
    for sub_env, own in enumerate(seeds):
        current[sub_env] = list(own)
        played[own[0]].append(observation[sub_env].tolist())
    for _ in range(200):
        which = np.flatnonzero(~env.ended)
        if not len(which):
            break
        answer = env.step(which, zeros(env)[which])
        ended = answer[2] | answer[3]
        finals = answer[4].get("final_obs", [None] * len(which))
        for row, sub_env in enumerate(which):
            if mode == "SameStep" and ended[row] and len(current[sub_env]) > 1:
                played[current[sub_env].pop(0)].append(finals[row].tolist())
            elif mode == "NextStep" and current[sub_env][0] == "over":
                current[sub_env].pop(0)
            played[current[sub_env][0]].append(answer[0][row].tolist())
            if mode == "NextStep" and ended[row] and len(current[sub_env]) > 1:
                current[sub_env][0] = "over"
    assert env.ended.all()
    last = env.step(None, zeros(env))
    assert (last[1].tolist(), last[2].any(), last[3].any()) == ([0.0] * 3, False, False)
    assert last[4] == {}
    for sub_env, own in enumerate(seeds):
        assert last[0][sub_env].tolist() == played[own[-1]][-1]
    for seed, observations in played.items():
        first, _ = alone.reset(seed, None, None)
        expected = [first[0].tolist()]
        while not alone.ended[0]:
            expected.append(alone.step(None, zeros(alone))[0][0].tolist())
        assert observations == expected


# What goes wrong -----------------------------------------------------------------------------


@pytest.mark.parametrize("num_workers", [0, 3])
def test_a_failure_names_its_sub_env_and_the_others_are_reset_with_it(make, num_workers):
    env = make("SpoilsOneSubEnv", num_workers=num_workers, space="Discrete", longest=1)
    env.reset(1, None, None)
    with pytest.raises(GymServerError, match=r"Sub-environment \d raised ValueError: .*too long"):
        for _ in range(3):
            env.step(None, zeros(env))
    first, _ = env.reset(1, None, None)
    assert len(first) == 3


def test_a_failure_that_cannot_be_sent_is_told(make):
    env = make("CannotSaySo")
    env.reset(1, None, None)
    with pytest.raises(GymServerError, match=r"Sub-environment \d raised"):
        env.step(None, zeros(env))


@pytest.mark.parametrize("how", ["itself", "killed"])
def test_a_process_that_ends_takes_its_environment_with_it(make, how, eventually):
    env = make("KillsItself" if how == "itself" else "Uneven")
    told = []
    env.report_end(told.append)
    env.reset(1, None, None)
    pids = env.pids
    if how == "killed":
        os.kill(pids[1], signal.SIGKILL)
    with pytest.raises(GymServerError) as refusal:
        for _ in range(3):
            env.step(None, zeros(env))
    assert refusal.value.code == "environment_died"
    eventually(lambda: not any(map(is_running, pids)))
    eventually(lambda: [why.code for why in told] == ["environment_died"])


def test_what_cannot_be_sent_is_refused(make):
    gymnasium.register("Local-v0", entry_point=lambda: gymnasium.make("CartPole-v1"))
    try:
        with pytest.raises(GymServerError, match="cannot be made in another process") as refusal:
            make("Local")
        assert refusal.value.code == "not_supported"
        assert make("Local", num_workers=0).num_envs == 3
    finally:
        del gymnasium.registry["Local-v0"]


_DIES = """
import sys, threading, time
from gym_server.rendering.render_thread import RenderThread
from gym_server.spaces.stacking import stack
from gym_server.vector_envs.sub_env import SubEnv
from gym_server.vector_envs.sub_envs import SubEnvs
from gymnasium.vector import AutoresetMode
import gymnasium, faulty_envs, numpy
if __name__ == "__main__":
    spec = gymnasium.spec("Hanging-v0")
    sub_env = SubEnv(spec, None, {}, (), RenderThread())
    env = SubEnvs(sub_env, 2, AutoresetMode.NEXT_STEP, 2, RenderThread())
    env.reset(None, None, None)
    actions = numpy.zeros(2, numpy.int64)
    threading.Thread(target=env.step, args=(None, actions), daemon=True).start()
    print(*env.pids, flush=True)
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
    assert server.stop()[0] == 0
    eventually(lambda: not any(map(is_running, children)))


def test_a_step_that_hangs_in_a_process_does_not_keep_the_server(serve, gate, eventually):
    server = serve(limits=SHORT_GRACE)
    how = {"num_envs": 2, "vectorization_mode": "async"}
    url = server.create("faulty_envs:Gated-v0", kwargs=gate.kwargs, **how)
    server.post(f"{url}/reset/")
    children = descendants(server.process.pid)
    with server.socket() as connection:
        body = b'{"action": [0, 0]}'
        connection.sendall(
            b"POST %b/step/ HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: %d\r\n\r\n%b"
            % (url.encode(), len(body), body)
        )
        eventually(gate.is_reached)
        assert server.stop()[0] == 0
    # Before the gate is opened.
    eventually(lambda: not any(map(is_running, children)))
