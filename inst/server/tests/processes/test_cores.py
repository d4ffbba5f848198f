import os

import pytest

from gym_server.processes.cores import spread, usable_cores

HAS_AFFINITY = hasattr(os, "sched_getaffinity")


@pytest.fixture
def eight(monkeypatch):
    if HAS_AFFINITY:
        monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(8)))
    else:
        monkeypatch.setattr(os, "cpu_count", lambda: 8)


@pytest.mark.parametrize(
    ("text", "cores"),
    [
        ("max 100000", 8),
        ("200000 100000", 2),
        ("150000 100000", 2),
        ("50000 100000", 1),
        ("1600000 100000", 8),
        ("rubbish", 8),
    ],
)
def test_a_cgroup_limits_the_cores(eight, tmp_path, text, cores):
    (tmp_path / "cpu.max").write_text(f"{text}\n")
    assert usable_cores(tmp_path) == cores


@pytest.mark.parametrize(("told", "cores"), [("3", 3), ("default", 8), ("0", 8)])
def test_a_variable_says_how_many_cores_to_use(eight, tmp_path, monkeypatch, told, cores):
    monkeypatch.setenv("PYTHON_CPU_COUNT", told)
    assert usable_cores(tmp_path) == cores


def test_without_a_limit_all_cores_of_the_affinity_count(eight, tmp_path):
    assert usable_cores(tmp_path) == 8


@pytest.mark.parametrize(
    ("cores", "count", "shares"),
    [
        ({0, 1}, 2, [{0}, {1}]),
        ({2, 3, 5}, 2, [{2, 5}, {3}]),
        ({4, 6}, 3, [{4}, {6}, {4}]),
        ({7}, 1, [{7}]),
    ],
)
def test_each_process_gets_cores_of_its_own(monkeypatch, cores, count, shares):
    given = {}
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: cores, raising=False)
    monkeypatch.setattr(
        os,
        "sched_setaffinity",
        lambda process, share: given.update({process: set(share)}),
        raising=False,
    )
    spread(range(count))
    assert list(given.values()) == shares


def test_a_process_that_has_ended_gets_none(monkeypatch):
    asked = []

    def refuse(process, share):
        asked.append(process)
        raise ProcessLookupError

    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0, 1}, raising=False)
    monkeypatch.setattr(os, "sched_setaffinity", refuse, raising=False)
    spread([11, 12])
    assert asked == [11, 12]
