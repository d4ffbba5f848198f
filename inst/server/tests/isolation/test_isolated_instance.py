"""Environments in their own processes, through a real server: they answer like others."""

import itertools
import json
import os
import signal
import threading
import time

import pytest
from conftest import ON_A_FREE_PORT, ServerProcess
from running import descendants

pytestmark = pytest.mark.slow

needs_posix = pytest.mark.skipif(os.name != "posix", reason="signals, and processes by fork")


@pytest.fixture(scope="module")
def servers(tmp_path_factory):
    """Return a server with a process for each environment, and one without processes."""
    servers = {}
    for mode in ("all", "none"):
        directory = tmp_path_factory.mktemp(mode)
        arguments = ["--isolate", mode, "--monitor-dir", str(directory)]
        servers[mode] = ServerProcess(*ON_A_FREE_PORT, *arguments)
        servers[mode].directory = directory
    yield servers
    for server in servers.values():
        server.kill()


@pytest.fixture
def isolated(servers):
    return servers["all"]


def raw(server, method, path, body=b"", accept="application/json"):
    connection = server.connect()
    kind = "application/x-safetensors" if body[8:9] == b"{" else "application/json"
    connection.request(method, path, body, {"Accept": accept, "Content-Type": kind})
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, answer.getheader("Content-Type"), content


def both(servers, env_id, calls, **fields):
    """Return the responses of each server to calls, a list of method, path, body and accept."""
    heard = []
    for server in servers.values():
        url = server.create(env_id, **fields)
        answers = []
        for method, path, body, accept in calls:
            body = json.dumps(body).encode() if isinstance(body, dict) else body
            answers.append(raw(server, method, f"{url}/{path}", body, accept))
        raw(server, "POST", f"{url}/close/")
        heard.append(answers)
    return heard


def calls_of(action, accept):
    key = f"k{next(_keys)}"
    request = [{"request": {"key": key, "number": number}} for number in range(4)]
    return [
        ("POST", "step/", {"action": action}, accept),
        ("POST", "reset/", {"seed": 5, **request[0]}, accept),
        ("POST", "step/", {"action": action, **request[1]}, accept),
        ("POST", "step/", {"action": action, **request[1]}, accept),
        ("POST", "step/", {"action": action, **request[2]}, accept),
        ("POST", "step/", {"action": "nonsense", **request[3]}, accept),
        ("POST", "step/", {"action": action}, accept),
        ("GET", "action_space/", b"", accept),
        ("GET", "observation_space/", b"", accept),
        ("GET", "action_space/sample/", b"", accept),
        ("POST", "action_space/contains/", {"value": action}, accept),
        ("POST", "observation_space/contains/", {"value": action}, accept),
        ("GET", "render/", b"", "image/png"),
        ("GET", "render/?sub_env=9", b"", "image/png"),
        ("POST", "reset/", {"seed": [1]}, accept),
        ("POST", "reset/", {"seed": 6, "info": False}, accept),
        ("POST", "step/", {"action": action, "info": False}, accept),
    ]


_keys = itertools.count()

CASES = [
    ("CartPole-v1", 1, {}),
    ("CartPole-v1", [0, 1, 1], {"num_envs": 3}),
    ("CartPole-v1", [0, 1, 1], {"num_envs": 3, "autoreset_mode": "SameStep"}),
    ("CartPole-v1", [0, 1], {"num_envs": 2, "vectorization_mode": "async"}),
    ("Pendulum-v1", [0.25], {"wrappers": [{"name": "TimeAwareObservation"}]}),
    ("faulty_envs:Letters-v0", [1, 2, 3], {}),
    ("faulty_envs:NotANumber-v0", 0, {}),
]


FORMS = [
    "application/json",
    "application/x-safetensors",
    "application/x-safetensors; order=column",
]


@pytest.mark.parametrize(("env_id", "action", "fields"), CASES)
def test_an_isolated_environment_answers_as_any_other_does(servers, env_id, action, fields):
    # One after another in the same environment.
    calls = [call for accept in FORMS for call in calls_of(action, accept)]
    isolated, ordinary = both(servers, env_id, calls, **fields)
    for call, ours, theirs in zip(calls, isolated, ordinary, strict=True):
        assert ours == theirs, call
    for status, _, content in ordinary[2 :: len(calls) // len(FORMS)]:
        assert status == 200 and b'"request' in content


def test_sub_environments_that_rest_take_no_steps(isolated):
    how = {"num_envs": 2, "autoreset_mode": "SameStep", "kwargs": {"length": 2}}
    url = isolated.create("faulty_envs:Counting-v0", **how)
    isolated.post(f"{url}/reset/", {"seed": [[1], [1, 2]]})
    for _ in range(6):
        isolated.post(f"{url}/step/", {"action": [0, 0]})
    assert isolated.get(url)[1]["steps"] == 2 + 4


@pytest.mark.parametrize("depth", [100, 900])
def test_no_depth_of_an_action_is_a_fault_of_the_servers(isolated, depth):
    url = isolated.create("CartPole-v1")
    isolated.post(f"{url}/reset/")
    body = f'{{"action": {"[" * depth}{"]" * depth}}}'.encode()
    status, _, content = raw(isolated, "POST", f"{url}/step/", body)
    assert status == 400, content
    assert isolated.post(f"{url}/step/", {"action": 1})[0] == 200


def test_actions_travel_as_tensors(servers):
    action = b'{"action":{"dtype":"I64","shape":[3],"data_offsets":[0,24]}}'
    action += b" " * (-len(action) % 8)
    body = len(action).to_bytes(8, "little") + action + b"\1" + bytes(23)
    tensors = "application/x-safetensors"
    calls = [
        ("POST", "reset/", {"seed": 1}, tensors),
        ("POST", "step/", body, tensors),
        ("POST", "step/", {"action": [1, 0, 0]}, tensors),
    ]
    isolated, ordinary = both(servers, "CartPole-v1", calls, num_envs=3)
    assert isolated == ordinary
    assert [answer[0] for answer in ordinary] == [200, 200, 200]


def test_what_is_known_of_it_is_the_same(servers):
    abouts = []
    for server in servers.values():
        url = server.create("CartPole-v1", seed=3, kwargs={"sutton_barto_reward": True})
        server.post(f"{url}/reset/")
        server.post(f"{url}/step/", {"action": 0})
        abouts.append(server.get(f"{url}/")[1])
    assert [about.pop("isolated") for about in abouts] == [True, False]
    for about in abouts:
        for name in ("instance_id", "age_seconds", "idle_seconds"):
            del about[name]
    assert abouts[0] == abouts[1]


def test_watchers_see_it_move(servers):
    states = []
    for server in servers.values():
        url = server.create("CartPole-v1")
        blank = server.get(f"{url}/watch/state/")[1]
        assert blank["state"] == "not_reset"
        server.post(f"{url}/reset/", {"seed": 1})
        first = server.get(f"{url}/watch/state/?after={blank['number']}")[1]
        heard = []
        arguments = (f"{url}/watch/state/?after={first['number']}",)
        watcher = threading.Thread(target=lambda s=server, a=arguments: heard.append(s.get(*a)))  # noqa: B023
        watcher.start()
        time.sleep(0.2)
        assert server.get(f"{url}/")[1]["watched"]
        server.post(f"{url}/step/", {"action": 1})
        watcher.join(10)
        states.append([first, heard[0][1]])
        assert states[-1][1]["step"] == 1 and states[-1][1]["frame"] != first["frame"]
    assert states[0] == states[1]


def test_it_moves_in_real_time_while_somebody_watches(isolated):
    url = isolated.create("CartPole-v1", render_mode="human")
    isolated.post(f"{url}/reset/")
    isolated.get(f"{url}/watch/presence/")
    began = time.monotonic()
    for _ in range(10):
        isolated.post(f"{url}/step/", {"action": 1})
    assert time.monotonic() - began > 8 / 50


def test_monitors_write_and_are_refused_as_ever(servers):
    tables = []
    for server in servers.values():
        url, other = server.create("CartPole-v1"), server.create("CartPole-v1")
        monitor = f"{url}/monitor/start/"
        assert server.post(monitor, {"directory": "../up"})[1]["code"] == "monitor_directory"
        assert server.post(monitor, {"directory": "here"})[0] == 204
        assert server.post(monitor, {"directory": "there"})[1]["code"] == "monitor_active"
        assert server.post(f"{other}/monitor/start/", {"directory": "here"})[0] == 204
        own = str(server.directory / "here" / other[-8:])
        assert server.get(f"{other}/")[1]["monitor"]["directory"] == own
        assert server.post(f"{other}/monitor/close/")[0] == 204
        server.post(f"{url}/reset/", {"seed": 1})
        while not server.post(f"{url}/step/", {"action": 1})[1]["done"]:
            pass
        assert server.get(f"{url}/")[1]["monitor"]["episodes"] == 1
        assert server.post(f"{url}/monitor/close/")[0] == 204
        assert server.post(f"{url}/monitor/close/")[0] == 204
        again = {"directory": "here", "resume": True}
        assert server.post(f"{url}/monitor/start/", again)[0] == 204
        assert server.post(f"{other}/close/")[0] == 204
        lines = (server.directory / "here" / "episodes.csv").read_text().splitlines()
        tables.append([line.rpartition(",")[0] for line in lines])
    assert tables[0] == tables[1]


def test_its_errors_are_those_that_it_would_have(servers):
    for env_id, fields in [
        ("CartPole-v9", {}),
        ("CartPole-v1", {"kwargs": {"nonsense": 1}}),
        ("faulty_envs:RaisesInConstructor-v0", {}),
        ("faulty_envs:LongDouble-v0", {}),
        ("os:Id-v0", {}),
        ("CartPole-v1", {"num_envs": 20_000}),
    ]:
        answers = [s.post("/v1/envs/", {"env_id": env_id, **fields}) for s in servers.values()]
        assert answers[0] == answers[1]
        assert answers[0][0] in (400, 429, 500)
    for name in ("RaisesInStep", "RaisesInClose", "CannotSaySo"):
        calls = [
            ("POST", "reset/", b"", ""),
            ("POST", "step/", {"action": 1}, ""),
            ("POST", "close/", b"", ""),
            ("POST", "step/", {"action": 1}, ""),
        ]
        answers = both(servers, f"faulty_envs:{name}-v0", calls)
        assert len(answers[0]) == 4
        assert [a[0] for a in answers[0]] == [a[0] for a in answers[1]]


def test_its_model_is_the_one_that_it_would_have(servers):
    for env_id, fields, status in [
        ("FrozenLake-v1", {"kwargs": {"map_name": "8x8"}}, 200),
        ("Taxi-v4", {}, 200),
        ("CliffWalking-v1", {}, 200),
        ("CliffWalking-v1", {"num_envs": 2}, 400),
        ("CliffWalking-v1", {"wrappers": [{"name": "FlattenObservation"}]}, 400),
        ("CartPole-v1", {}, 400),
        ("faulty_envs:Table-v0", {"kwargs": {"P": "half a probability"}}, 400),
        ("faulty_envs:Table-v0", {"kwargs": {"P": "itself"}}, 400),
        ("faulty_envs:Table-v0", {"kwargs": {"P": "raises"}}, 500),
    ]:
        calls = [("GET", "model/", b"", ""), ("POST", "reset/", {"seed": 1}, "")]
        isolated, ordinary = both(servers, env_id, calls, **fields)
        assert isolated == ordinary
        assert [answer[0] for answer in ordinary] == [status, 200]
    answer = json.loads(both(servers, "Taxi-v4", [("GET", "model/", b"", "")])[0][0][2])
    assert len(answer["model"]["state"]) == 3_000


def test_an_environment_that_is_closed_has_no_process_any_more(isolated, eventually):
    before = set(descendants(isolated.process.pid))
    url = isolated.create("CartPole-v1", num_envs=2, vectorization_mode="async")
    assert len(set(descendants(isolated.process.pid)) - before) >= 3
    assert isolated.post(f"{url}/close/")[0] == 204
    assert isolated.post(f"{url}/close/")[1]["code"] == "unknown_instance"
    eventually(lambda: not set(descendants(isolated.process.pid)) - before)


@needs_posix
def test_one_that_lets_no_thread_of_its_process_run_delays_nobody(isolated):
    url = isolated.create("faulty_envs:Rogue-v0", kwargs={"does": "never_returns"})
    pid = isolated.post(f"{url}/reset/")[1]["info"]["pid"]
    heard = []
    call = threading.Thread(
        target=lambda: heard.append(isolated.post(f"{url}/step/", {"action": 0})), daemon=True
    )
    call.start()
    time.sleep(0.3)
    assert isolated.get(f"{url}/")[1]["steps"] == 0
    other = isolated.create("CartPole-v1")
    assert isolated.post(f"{other}/reset/")[0] == 200
    os.kill(pid, signal.SIGKILL)
    call.join(10)
    assert heard[0][1]["code"] == "environment_died"


def test_modules_are_imported_in_other_processes_only(serve, tmp_path):
    module = tmp_path / "tells_where.py"
    module.write_text(
        "import os, gymnasium\n"
        "open(os.environ['TOLD'], 'a').write(f'{os.getpid()}\\n')\n"
        "from gymnasium.envs.classic_control import CartPoleEnv\n"
        "gymnasium.register('Told-v0', entry_point=CartPoleEnv)\n"
    )
    told = tmp_path / "told"
    server = serve("--allow-module", "tells_where", PYTHONPATH=str(tmp_path), TOLD=str(told))
    assert server.create("tells_where:Told-v0")
    assert "Told-v0" in {one["id"] for one in server.get("/v1/registry/")[1]["environments"]}
    # With the id from the list.
    assert server.get(f"{server.create('Told-v0')}/")[1]["isolated"]
    assert not server.get(f"{server.create('CartPole-v1')}/")[1]["isolated"]
    pids = told.read_text().split()
    assert len(pids) == 3
    assert str(server.process.pid) not in pids


@pytest.mark.parametrize("hangs", [True, False])
def test_a_module_that_hangs_or_stays_leaves_no_process_of_the_list(
    serve, tmp_path, eventually, hangs
):
    module = tmp_path / "never_ends.py"
    sleep = "time.sleep(3600)"
    wait = sleep if hangs else f"threading.Thread(target=lambda: {sleep}).start()"
    module.write_text(f"import threading, time\n{wait}\n")
    limit = "2" if hangs else "60"
    arguments = ("--allow-module", "never_ends", "--max-call-seconds", limit)
    server = serve(*arguments, PYTHONPATH=str(tmp_path))
    # The processes that start others stay. This call may be too slow on a busy machine.
    server.post("/v1/envs/", {"env_id": "faulty_envs:Counting-v0"})
    eventually(lambda: len(descendants(server.process.pid)) >= 2)
    before = set(descendants(server.process.pid))
    status, answer = server.get("/v1/registry/?search=CartPole-v1")
    assert (status, answer["environments"][0]["id"]) == (200, "CartPole-v1")
    eventually(lambda: set(descendants(server.process.pid)) <= before)
