import pytest

from gym_server.envs import allowed_paths
from gym_server.envs.config import EnvConfig, Wrapper
from gym_server.errors import GymServerError


def refusal(kwargs=None, wrappers=(), may=False):
    try:
        allowed_paths.check(EnvConfig("A-v0", kwargs=kwargs, wrappers=wrappers), may)
    except GymServerError as error:
        assert error.code == "invalid_kwargs"
        return error
    return None


PATHS = [
    "/etc/passwd",
    "../x",
    "..",
    ".",
    ".bashrc",
    "a/b",
    "a\\b",
    "~",
    "~root",
    "C:x",
    "c:\\x",
    "\\\\host\\share",
    "x\0",
    "http://host/x",
    "file:///etc/passwd",
]


@pytest.mark.parametrize("path", PATHS)
def test_a_path_is_refused_wherever_it_stands(path):
    for kwargs in (
        {"a": path},
        {"a": [[{"b": [1, path]}]]},
        {"a": {path: 1}},
    ):
        said = refusal(kwargs)
        assert said is not None and "server of your own" in said.hint
    assert refusal(wrappers=(Wrapper("TimeLimit", {"a": [path]}),)) is not None


@pytest.mark.parametrize("path", PATHS)
def test_whoever_has_a_server_of_their_own_may_name_any(path):
    assert refusal({"a": [path]}, may=True) is None


def test_words_are_no_paths():
    words = ["4x4", "SFFF", "rgb_array", "ant.xml", "", "a b", "ÄÖ", "1.5", "ab:c", "x~"]
    assert refusal({"a": words, "b": None, "c": True, "d": 1.5}) is None


def test_what_is_nested_without_end_is_refused_on_any_server():
    deep = []
    for _ in range(10_000):
        deep = [deep]
    assert "nested" in refusal({"a": deep}, may=True).message
