import sys

import pytest

from gym_server.envs.allowed_paths import AllowedPaths
from gym_server.envs.config import EnvConfig, Wrapper
from gym_server.errors import GymServerError


def refusal(paths, kwargs=None, wrappers=()):
    try:
        paths.check(EnvConfig("A-v0", kwargs=kwargs, wrappers=wrappers))
    except GymServerError as error:
        assert error.code == "invalid_kwargs"
        return error
    return None


@pytest.fixture
def allowed(tmp_path):
    (tmp_path / "models").mkdir()
    return AllowedPaths([tmp_path / "models"])


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
    none = AllowedPaths([])
    for kwargs in (
        {"a": path},
        {"a": [[{"b": [1, path]}]]},
        {"a": {path: 1}},
    ):
        said = refusal(none, kwargs)
        assert said is not None and "--allow-path" in said.hint
    assert refusal(none, wrappers=(Wrapper("TimeLimit", {"a": [path]}),)) is not None


@pytest.mark.parametrize("path", PATHS)
def test_whoever_started_the_server_may_name_any(path):
    assert refusal(AllowedPaths(), {"a": [path]}) is None


def test_words_are_no_paths():
    words = ["4x4", "SFFF", "rgb_array", "ant.xml", "", "a b", "ÄÖ", "1.5", "ab:c", "x~"]
    assert refusal(AllowedPaths([]), {"a": words, "b": None, "c": True, "d": 1.5}) is None


def test_what_lies_in_an_allowed_directory_may_be_named(allowed, tmp_path):
    models = tmp_path / "models"
    for path in (models / "a.xml", models / "b" / "c.xml", models / "b" / ".." / "a.xml"):
        assert refusal(allowed, {"a": str(path)}) is None
    for path in (models, tmp_path / "modelsx" / "a", models / ".." / "a", tmp_path / "a"):
        assert refusal(allowed, {"a": str(path)}) is not None


def test_only_a_whole_path_says_what_it_means(allowed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path / "models")
    assert refusal(allowed, {"a": "./a.xml"}) is not None


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
def test_a_link_leads_out_of_no_directory(allowed, tmp_path):
    (tmp_path / "models" / "out").symlink_to("/etc")
    (tmp_path / "models" / "loop").symlink_to(tmp_path / "models" / "loop")
    for name in ("out", "out/passwd", "loop/x"):
        path = str(tmp_path / "models" / name)
        assert refusal(allowed, {"a": path}) is not None, name


def test_what_is_nested_without_end_is_refused_on_any_server():
    deep = []
    for _ in range(10_000):
        deep = [deep]
    assert "nested" in refusal(AllowedPaths(), {"a": deep}).message
