import sys

import pytest
from conftest import SERVER

from gym_server.envs import extras


@pytest.mark.skipif(sys.version_info < (3, 11), reason="tomllib came with Python 3.11")
def test_the_hints_name_what_the_package_declares():
    import tomllib

    project = tomllib.loads((SERVER / "pyproject.toml").read_text())["project"]
    declared = project["optional-dependencies"]
    for name, requirements in extras.REQUIREMENTS.items():
        assert [one.partition(">")[0] for one in declared[name]] == list(requirements)
    # JAX takes as much disk as all others together, so it is left out.
    together = declared["all"][0] + "jax"
    assert all(name in together for name in extras.REQUIREMENTS)


def test_an_extra_is_installed_by_pip_or_by_uv(monkeypatch):
    command = extras.how_to_install("atari")
    assert command.endswith('-m pip install "gymnasium[atari]" "opencv-python-headless"')
    # As in an environment that uv made.
    monkeypatch.setattr(extras, "_is_installed", lambda module: module != "pip")
    command = extras.how_to_install("video")
    assert command.startswith('in a terminal: uv pip install --python "')
    assert command.endswith('" "moviepy"')
