"""The server's lock files are up to date with pyproject.toml."""

import hashlib
import json
import re
from pathlib import Path

import pytest
from packaging.requirements import Requirement

SERVER = Path(__file__).parent.parent
EXTRAS = ("toy-text", "box2d", "mujoco", "atari", "video", "jax", "sb3")
PINNED = re.compile(r"^([a-z0-9-]+)==([^ ]+)", re.MULTILINE)


@pytest.fixture(scope="module")
def project():
    tomllib = pytest.importorskip("tomllib")
    return tomllib.loads((SERVER / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def text(part):
    return (SERVER / "lock" / f"{part}.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize("part", ["base", *EXTRAS])
def test_the_lock_was_made_from_these_dependencies(part, project):
    asked = [project["dependencies"], {e: project["optional-dependencies"][e] for e in EXTRAS}]
    fingerprint = hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:16]
    assert f"# fingerprint: {fingerprint}\n" in text(part), "make it anew: tools/lock"


@pytest.mark.parametrize("part", ["base", *EXTRAS])
def test_every_dependency_is_locked_at_versions_that_fit(part, project):
    wanted = project["dependencies"] if part == "base" else project["optional-dependencies"][part]
    pinned = PINNED.findall(text("base") + text(part))
    for requirement in map(Requirement, wanted):
        versions = [version for name, version in pinned if name == requirement.name]
        assert versions, requirement
        assert all(version in requirement.specifier for version in versions), requirement


def test_there_is_a_lock_for_every_extra_but_the_developers_own(project):
    extras = set(project["optional-dependencies"]) - {"all", "dev"}
    assert extras == set(EXTRAS)
    assert {path.stem for path in (SERVER / "lock").iterdir()} == {"base", *extras}
