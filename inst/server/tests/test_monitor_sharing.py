"""Monitors of several instances in one directory, and what is left of those that are gone."""

import json
import re
import subprocess
import sys

import pytest

from gym_server.errors import GymServerError
from gym_server.monitoring.monitor_directory import MonitorRoot

ONE, TWO, THREE = "11111111", "22222222", "33333333"


@pytest.fixture
def claim(monitor_dir):
    """Claim files in one directory; all are given back in the end."""
    root = MonitorRoot(monitor_dir, allow_temporary=False)
    claimed = []

    def claim(instance_id, force=False, resume=False):
        files = root.claim("run", instance_id, force, resume)
        claimed.append(files)
        files.begin(["episode"])
        return files

    yield claim
    for files in claimed:
        files.table.close()


def play(files, *episodes):
    """Record some episodes, each with a video."""
    for number in episodes:
        files.table.write(f"{number}\n")
        files.next_episode = number + 1
        files.add(files.video_name(number))
        (files.path / files.video_name(number)).write_text("video")
    files.table.flush()
    return files


def crash(files):
    """Do to the files what the end of their process does."""
    files.table.close()


def names(files):
    return sorted(path.name for path in files.path.iterdir())


def of(instance_id, *episodes):
    suffix = f"-{instance_id}" if instance_id else ""
    videos = [f"rl-video{suffix}-episode-{number}.mp4" for number in episodes]
    return [f"episodes{suffix}.csv", f"gym-monitor{suffix}.json", *videos]


@pytest.mark.parametrize("options", [{}, {"force": True}, {"resume": True}])
def test_each_of_several_has_files_of_its_own(claim, options):
    one = play(claim(ONE, **options), 0, 1)
    two = play(claim(TWO, **options), 0)
    three = claim(THREE, **options)
    assert [files.next_episode for files in (one, two, three)] == [2, 1, 0]
    assert names(one) == sorted(of("", 0, 1) + of(TWO, 0) + of(THREE))


def test_force_removes_what_those_left_that_are_gone_and_nothing_of_the_living(claim):
    one, two = play(claim(ONE), 0), play(claim(TWO), 0, 1)
    play(claim(THREE), 0).release()
    claim("44444444", force=True)
    assert names(one) == sorted(of("", 0) + of(TWO, 0, 1) + of("44444444"))
    crash(one)
    crash(two)
    five = claim("55555555", force=True)
    assert (five.table_name, five.next_episode) == ("episodes.csv", 0)
    assert names(five) == sorted([*of(""), "episodes-44444444.csv", "gym-monitor-44444444.json"])


def test_a_crash_before_the_list_was_written_is_no_hindrance(claim, monitor_dir):
    (monitor_dir / "run").mkdir()
    (monitor_dir / "run" / "episodes.csv").touch()
    assert claim(ONE).table_name == "episodes.csv"


@pytest.mark.parametrize("gone", [ONE, TWO])
def test_what_is_left_behind_is_kept_unless_the_client_decides(claim, gone):
    files = {ONE: claim(ONE), TWO: claim(TWO)}
    play(files[gone], 0)
    crash(files[gone])
    before = names(files[gone])
    with pytest.raises(GymServerError, match="earlier monitor"):
        claim(THREE)
    assert names(files[gone]) == before


def test_resume_goes_on_where_the_first_one_stopped(claim):
    play(claim(ONE), 0, 1, 2).release()
    assert claim(TWO, resume=True).next_episode == 3
    assert claim(THREE, resume=True).next_episode == 0


def test_resume_goes_on_with_ones_own_files(claim):
    one = claim(ONE)
    play(claim(TWO), 0, 1).release()
    one.release()
    again = claim(TWO, resume=True)
    assert (again.table_name, again.next_episode) == (f"episodes-{TWO}.csv", 2)


def test_a_file_from_elsewhere_of_such_a_name_is_never_touched(claim, monitor_dir):
    (monitor_dir / "run").mkdir()
    mine = monitor_dir / "run" / f"episodes-{TWO}.csv"
    mine.write_text("mine")
    claim(ONE, force=True)
    with pytest.raises(GymServerError, match=mine.name):
        claim(TWO, force=True)
    assert mine.read_text() == "mine"


def test_what_was_deleted_under_a_monitor_does_not_spoil_the_next_one(claim, monitor_dir):
    one = play(claim(ONE), 0)
    for path in (monitor_dir / "run").iterdir():
        path.unlink()
    two = play(claim(TWO), 0, 1)
    with pytest.raises(FileNotFoundError):
        one.release()
    two.release()
    assert json.loads((two.path / "gym-monitor.json").read_text())["next_episode"] == 2


HOLD = """
import sys
from pathlib import Path
from gym_server.monitoring.monitor_directory import MonitorRoot
files = MonitorRoot(Path(sys.argv[1]), False).claim("run", "99999999", False, False)
files.begin(["episode"])
files.table.write("0\\n")
files.table.flush()
print("ready", flush=True)
sys.stdin.read()
"""


def test_another_process_keeps_its_files_until_it_is_killed(claim, monitor_dir):
    other = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(monitor_dir)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    try:
        assert other.stdout.readline() == b"ready\n"
        one = claim(ONE, force=True)
        assert one.table_name == f"episodes-{ONE}.csv"
        assert (one.path / "episodes.csv").read_text() == "episode\n0\n"
    finally:
        other.kill()
        other.communicate()
    two = claim(TWO, force=True)
    assert two.table_name == "episodes.csv"
    assert (two.path / "episodes.csv").read_text() == "episode\n"


# On the wire --------------------------------------------------------------------------------


def record(server, url, directory="agents", **fields):
    """Record an episode; return its table's name."""
    start = {"directory": directory, **fields}
    status, answer = server.post(f"{url}/monitor/start/", start)
    assert status == 204, answer
    server.post(f"{url}/reset/", {"seed": 0})
    while not server.post(f"{url}/step/", {"action": 1})[1]["done"]:
        pass
    return server.get(f"{url}/")[1]["monitor"]["table"]


@pytest.mark.parametrize("mode", ["none", pytest.param("all", marks=pytest.mark.slow)])
def test_six_agents_that_name_one_directory_all_record(serve, tmp_path, mode):
    options = ("--isolate", mode, "--monitor-dir", str(tmp_path))
    server = serve(*options)
    urls = [server.create("CartPole-v1") for _ in range(6)]
    tables = [record(server, url, force=True) for url in urls]
    assert tables[0] == "episodes.csv"
    assert all(re.fullmatch(r"episodes-[0-9a-f]{8}\.csv", table) for table in tables[1:])
    assert len(set(tables)) == 6
    for table in tables:
        assert len((tmp_path / "agents" / table).read_text().splitlines()) == 2

    server.kill()
    again = serve(*options)
    status, answer = again.post(
        f"{again.create('CartPole-v1')}/monitor/start/", {"directory": "agents"}
    )
    assert (status, answer["code"]) == (400, "monitor_directory")
    assert record(again, again.create("CartPole-v1"), force=True) == "episodes.csv"
    assert sorted(path.name for path in (tmp_path / "agents").iterdir()) == of("")
