"""Attacks on a real server by the contents of requests; all must fail."""

import os
import sys
import threading
import time

import pytest

pytestmark = pytest.mark.slow


@pytest.fixture
def refused(ask):
    """Create an environment that must be refused; return the code."""

    def refused(env_id="CartPole-v1", **fields):
        status, answer = ask("POST", "/v1/envs/", {"env_id": env_id, **fields})
        assert status == 400, answer
        assert len(answer["message"]) < 2000
        return answer["code"]

    return refused


@pytest.fixture
def made(ask):
    """Make an environment, return its URL, and close it afterwards."""
    urls = []

    def made(env_id="CartPole-v1", **fields):
        status, answer = ask("POST", "/v1/envs/", {"env_id": env_id, **fields})
        assert status == 200, answer
        urls.append(f"/v1/envs/{answer['instance_id']}")
        return urls[-1]

    yield made
    for url in urls:
        ask("POST", f"{url}/close/")


# Ids -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "env_id",
    [
        "os:Counting-v0",
        "subprocess:x-v0",
        "faulty_envs.os:Counting-v0",
        "faulty_envs:os:Counting-v0",
        "os:faulty_envs:Counting-v0",
        "../faulty_envs:Counting-v0",
        "/tmp/evil:Counting-v0",
        "faulty_envs\0:Counting-v0",
        ":CartPole-v1",
        "CartPole-v1;import os",
        "__import__('os'):x-v0",
        "CartPole-v1\n",
        "\u202eCartPole-v1",
        "GymV21Environment-v0",
        "GymV26Environment-v0",
        "x" * 10**6,
        "a-v" + "1" * 10**6 + "x",
        "-v1" * 300_000,
        "\ud800",
        ["CartPole-v1"],
        {"id": "CartPole-v1"},
        0,
        True,
    ],
    ids=lambda value: str(value)[:30].encode("ascii", "replace").decode().replace("\0", "NUL"),
)
def test_an_id_imports_nothing_that_was_not_allowed(refused, env_id):
    began = time.monotonic()
    code = refused(env_id)
    assert code in (
        "malformed_env_id",
        "module_not_allowed",
        "unknown_env_id",
        "deprecated_env_id",
        "invalid_parameter",
    )
    assert time.monotonic() - began < 10


def test_kwargs_do_not_reach_an_import_either(ask):
    for name in ("GymV21Environment-v0", "GymV26Environment-v0"):
        kwargs = {"env_id": "os:x-v0"}
        status, answer = ask("POST", "/v1/envs/", {"env_id": name, "kwargs": kwargs})
        assert (status, answer["code"]) == (400, "module_not_allowed")


# Kwargs --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "path",
    [
        "/etc/passwd",
        "../../../etc/passwd",
        "~/.ssh/id_rsa",
        "..\\..\\windows\\win.ini",
        "C:\\windows\\win.ini",
        "//host/share",
        "/etc/passwd\0.xml",
        "http://127.0.0.1:1/",
        "file:///etc/passwd",
        ".",
    ],
)
def test_kwargs_name_no_file(refused, path):
    assert refused("Ant-v5", kwargs={"xml_file": path}) == "invalid_kwargs"
    assert refused("FrozenLake-v1", kwargs={"desc": [path]}) == "invalid_kwargs"
    assert refused(kwargs={"a": {"b": [[{"c": path}]]}}) == "invalid_kwargs"
    wrapper = {"name": "TimeLimit", "kwargs": {"max_episode_steps": path}}
    assert refused(wrappers=[wrapper]) == "invalid_kwargs"
    assert refused(num_envs=2, kwargs={"a": path}) == "invalid_kwargs"


@pytest.mark.parametrize(
    "kwargs",
    [
        {"render_mode": "human"},
        {"render_fps": "__import__('os').system('true')"},
        {"__class__": "x"},
        {"self": 1},
        {"id": "os:x-v0"},
        {"entry_point": "os:system"},
        {"vector_entry_point": "os:system"},
        {"additional_wrappers": ["os:system"]},
        {"env_id": "os:x-v0"},
        {"disable_env_checker": "os:system", "vector_kwargs": {}},
        {"spec": {"entry_point": "os:system"}},
        {"wrappers": ["os:system"]},
    ],
    ids=str,
)
def test_kwargs_carry_no_code(refused, kwargs):
    assert refused(kwargs=kwargs) == "invalid_kwargs"
    for mode in ("vector_entry_point", "sync"):
        code = refused(kwargs=kwargs, num_envs=2, vectorization_mode=mode)
        assert code in ("invalid_kwargs", "not_supported")


@pytest.mark.parametrize(
    "wrapper",
    [
        "RecordVideo",
        "HumanRendering",
        "TransformObservation",
        "LambdaObservation",
        "vector",
        "__builtins__",
        "os",
        "utils.os.system",
        "NumpyToTorch",
        "",
        "TimeLimit\0",
    ],
)
def test_only_the_wrappers_on_the_list_are_taken(refused, wrapper):
    code = refused(wrappers=[{"name": wrapper, "kwargs": {"func": "os.system"}}])
    assert code == "wrapper_not_allowed"


# Monitors ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "directory",
    [
        "..",
        "../up",
        "a/../../up",
        "/etc/gym",
        "/tmp/gym-attack",
        "nul\0byte",
        ".",
        "",
        "~/gym/..",
        "x" * 5000,
        "a/" * 3000,
    ],
    ids=lambda text: text[:20].replace("\0", "NUL"),
)
def test_a_monitor_does_not_climb_out(attacked, ask, made, directory):
    status, answer = ask("POST", f"{made()}/monitor/start/", {"directory": directory})
    assert status == 400
    assert answer["code"] in ("monitor_directory", "missing_parameter")
    assert not os.path.exists("/tmp/gym-attack")
    assert sorted(path.name for path in attacked.root.iterdir()) == ["runs"]


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
def test_a_monitor_follows_no_link(attacked, ask, made, tmp_path):
    runs = attacked.root / "runs"
    (runs / "link").symlink_to(tmp_path)
    for directory in ("link", "link/a"):
        assert ask("POST", f"{made()}/monitor/start/", {"directory": directory})[0] == 400
    assert list(tmp_path.iterdir()) == []


def test_many_who_want_one_directory_get_one_of_their_own_each(attacked, ask, made):
    urls = [made() for _ in range(6)]
    statuses = []

    def start(url):
        fields = {"directory": "wanted", "force": True}
        statuses.append(ask("POST", f"{url}/monitor/start/", fields)[0])

    threads = [threading.Thread(target=start, args=(url,)) for url in urls]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert statuses == 6 * [204]
    directories = {ask("GET", f"{url}/")[1]["monitor"]["directory"] for url in urls}
    assert len(directories) == 6
    tables = (attacked.root / "runs" / "wanted").rglob("episodes.csv")
    assert directories == {str(path.parent) for path in tables}


# Searching, depth ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "search", ["(a+)+$", ".*", "[", "%00", "%ff", "x" * 50_000, "CartPole" * 6000], ids=len
)
def test_a_search_is_words_and_short(ask, search):
    began = time.monotonic()
    status, answer = ask("GET", f"/v1/registry/?search={search}")
    assert (status, answer.get("code")) in ((200, None), (400, "invalid_parameter"))
    assert status == (200 if len(search) < 100 else 400)
    assert time.monotonic() - began < 10


def nested(depth, opening, closing, core="0"):
    return opening * depth + core + closing * depth


@pytest.mark.parametrize("depth", [50, 400, 900, 5000, 10**6])
@pytest.mark.parametrize(("opening", "closing"), [("[", "]"), ('{"a":', "}")])
def test_nothing_is_too_deep(ask, made, depth, opening, closing):
    deep = nested(depth, opening, closing)
    url = made()
    bodies = {
        "/v1/envs/": f'{{"env_id":"CartPole-v1","kwargs":{{"a":{deep}}}}}',
        f"{url}/reset/": f'{{"options":{{"a":{deep}}}}}',
        f"{url}/step/": f'{{"action":{deep}}}',
        f"{url}/action_space/contains/": f'{{"value":{deep}}}',
        f"{url}/observation_space/contains/": f'{{"name":"Box","low":{deep}}}',
        f"{url}/monitor/start/": f'{{"directory":{deep}}}',
        "/v1/upload/": deep,
    }
    for path, body in bodies.items():
        status, answer = ask("POST", path, body)
        assert status in (200, 400, 410, 413), (path, answer)
    made("faulty_envs:Counting-v0")


def test_a_space_as_deep_as_a_client_likes_is_described(ask):
    for depth in (10, 200, 2000):
        kwargs = {"depth": depth}
        status, answer = ask(
            "POST", "/v1/envs/", {"env_id": "faulty_envs:Deep-v0", "kwargs": kwargs}
        )
        assert status in (200, 400, 500), answer
        assert answer.get("code") != "internal_error", answer
        if status == 200:
            url = f"/v1/envs/{answer['instance_id']}"
            for path in ("/", "/observation_space/", "/action_space/sample/"):
                assert ask("GET", url + path)[0] == 200, path
            assert ask("POST", f"{url}/reset/")[0] == 200
            ask("POST", f"{url}/close/")
