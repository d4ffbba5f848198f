"""Environments that end or attack their own process do not affect others."""

import os
import select
import signal
import threading
import time

import pytest
from conftest import ServerProcess
from running import descendants, is_running

from gym_server.processes.worker_process import WorkerProcess

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name != "posix", reason="signals, and processes by fork"),
]


@pytest.fixture(scope="module")
def server():
    server = ServerProcess("--port", "0", "--allow-module", "faulty_envs")
    yield server
    server.kill()


IN_A_PROCESS = {"num_envs": 1, "vectorization_mode": "async"}


def rogue(server, **kwargs):
    url = server.create("faulty_envs:Rogue-v0", kwargs=kwargs, **IN_A_PROCESS)
    status, answer = server.post(f"{url}/reset/")
    assert status == 200, answer
    return url, answer["info"]["pid"][0]


ENDS = [
    ("exits", "exit status 7"),
    ("is_killed", "signal SIGKILL"),
    ("crashes", "signal SIGSEGV"),
    ("closes_all_files", ""),
    ("forks_and_exits", "exit status 8"),
    ("forks_a_stranger_and_exits", "exit status 8"),
]


@pytest.mark.parametrize(("does", "how"), ENDS)
def test_it_is_told_how_a_process_ended_and_the_instance_is_gone(server, does, how, eventually):
    url, pid = rogue(server, does=does)
    status, answer = server.post(f"{url}/step/", {"action": [0]})
    assert (status, answer["code"]) == (500, "environment_died")
    assert how in answer["message"]
    # All later calls get the reason.
    eventually(lambda: url[-8:] not in server.get("/v1/envs/")[1]["all_envs"])
    for method, path in [(server.post, "step/"), (server.get, ""), (server.post, "close/")]:
        arguments = [{"action": [0]}] if path == "step/" else []
        assert method(f"{url}/{path}", *arguments) == (status, answer)
    eventually(lambda: not is_running(pid))
    assert server.get("/v1/health/")[0] == 200


def test_what_it_forked_ends_with_it(server, eventually):
    before = set(descendants(server.process.pid))
    url, pid = rogue(server, does="forks_and_exits")
    server.post(f"{url}/step/", {"action": [0]})
    eventually(lambda: not any(is_in_group(one, pid) for one in _all_processes()))
    assert set(descendants(server.process.pid)) <= before


def _all_processes():
    pids = [int(name) for name in os.listdir("/proc") if name.isdecimal()]
    return [pid for pid in pids if os.path.exists(f"/proc/{pid}") and is_running_safely(pid)]


def is_in_group(pid, group):
    try:
        return os.getpgid(pid) == group
    except ProcessLookupError:  # It ended since it was listed.
        return False


def is_running_safely(pid):
    try:
        return is_running(pid)
    except OSError:
        return False


def test_what_it_sent_before_it_ended_is_read_afterwards(eventually):
    process = WorkerProcess("gym_server.envs.registry")
    process.begin("search", "CartPole", ())
    eventually(lambda: select.select([process._calls._pipe._socket], [], [], 0)[0])
    os.kill(process.pid, signal.SIGKILL)
    eventually(lambda: not process.is_alive)
    # The thread that waited for the end now closes its pipes.
    time.sleep(0.2)
    assert process.finish()[0]["id"].startswith("CartPole-v")


def test_it_is_told_when_it_ends_while_it_draws(server):
    url, _ = rogue(server, does="exits", at="render")
    status, answer = server.get(f"{url}/render/")
    assert (status, answer["code"]) == (500, "environment_died")


def test_a_watcher_hears_of_the_end(server):
    url, pid = rogue(server)
    number = server.get(f"{url}/watch/state/")[1]["number"]
    heard = []
    watcher = threading.Thread(
        target=lambda: heard.append(server.get(f"{url}/watch/state/?after={number}"))
    )
    watcher.start()
    time.sleep(0.2)
    os.kill(pid, signal.SIGKILL)
    watcher.join(10)
    assert heard[0][1]["code"] == "environment_died"


@pytest.mark.parametrize("does", ["prints", "ignores_sigterm"])
def test_what_is_no_end_is_none(server, does, eventually):
    url, pid = rogue(server, does=does)
    assert server.post(f"{url}/step/", {"action": [0]})[0] == 200
    assert server.post(f"{url}/step/", {"action": [0]})[0] == 200
    assert server.post(f"{url}/close/")[0] == 204
    eventually(lambda: not is_running(pid))


def test_one_that_ends_its_process_disturbs_none_of_twenty_that_run(server):
    urls = [server.create("faulty_envs:Counting-v0", kwargs={"length": 1000}) for _ in range(19)]
    ending, _ = rogue(server, does="exits")
    for url in urls:
        server.post(f"{url}/reset/")
    disturbed = []

    def run(url):
        connection = server.connect()
        for number in range(1, 61):
            connection.request("POST", f"{url}/step/", '{"action": 1}')
            answer = connection.getresponse()
            if f'"observation":[{number}]'.encode() not in answer.read():
                disturbed.append(url)
        connection.close()

    threads = [threading.Thread(target=run, args=(url,)) for url in urls]
    for thread in threads:
        thread.start()
    assert server.post(f"{ending}/step/", {"action": [0]})[1]["code"] == "environment_died"
    for thread in threads:
        thread.join(60)
    assert disturbed == []
    for url in urls:
        server.post(f"{url}/close/")


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_no_process_outlives_the_server(serve, how, eventually):
    server = serve()
    pids = [rogue(server)[1] for _ in range(2)]
    sub_envs = server.create("faulty_envs:Uneven-v0", num_envs=2, vectorization_mode="async")
    assert server.post(f"{sub_envs}/reset/")[0] == 200
    if how == signal.SIGKILL:
        stuck, pid = rogue(server, does="never_returns")
        pids.append(pid)
        call = threading.Thread(target=_without_answer, args=(server, f"{stuck}/step/"))
        call.start()
        time.sleep(0.3)
    children = descendants(server.process.pid)
    assert set(pids) < set(children)
    server.stop(how)
    eventually(lambda: not any(map(is_running, children)))


def _without_answer(server, url):
    try:
        server.post(url, {"action": [0]})
    except Exception:
        return


def test_many_that_come_and_go_leave_nothing_behind(server, eventually):
    def left():
        files = len(os.listdir(f"/proc/{server.process.pid}/fd"))
        threads = len(os.listdir(f"/proc/{server.process.pid}/task"))
        return files, threads, len(descendants(server.process.pid))

    rogue(server, does="nothing")
    eventually(lambda: left() == left())
    time.sleep(0.5)
    before = left()
    for _ in range(5):
        url, _ = rogue(server)
        assert server.post(f"{url}/close/")[0] == 204
        url, _ = rogue(server, does="exits")
        server.post(f"{url}/step/", {"action": [0]})
    eventually(lambda: all(a <= b for a, b in zip(left(), before, strict=True)))
