"""Monitors that share a directory each get their own; files of ended monitors."""

import subprocess
import sys

import pytest

from gym_server.errors import GymServerError
from gym_server.monitoring.monitor_directory import MonitorRoot, take_directory

pytestmark = pytest.mark.slow

ONE, TWO, THREE = "11111111", "22222222", "33333333"


@pytest.fixture
def take(monitor_dir):
    """Take a directory of the same name; all are released at the end."""
    root = MonitorRoot(monitor_dir, allow_temporary=False)
    taken = []

    def take(instance_id, force=False, resume=False):
        taken.append(take_directory(root.resolve("run"), "run", instance_id, force, resume))
        return taken[-1]

    yield take
    for directory in taken:
        directory.table.close()


def play(directory, *episodes):
    """Record some episodes, each with a video."""
    for number in episodes:
        directory.table.write(f"{number},1.0,1,0.1\n")
        (directory.path / f"rl-video-episode-{number}.mp4").write_text("video")
    directory.table.flush()
    return directory


def crash(directory):
    """Leave a directory as if its process had ended."""
    directory.table.close()


def files(monitor_dir):
    run = monitor_dir / "run"
    return sorted(str(path.relative_to(run)) for path in run.rglob("*") if path.is_file())


def of(instance_id, *episodes):
    prefix = f"{instance_id}/" if instance_id else ""
    videos = [f"{prefix}rl-video-episode-{number}.mp4" for number in episodes]
    return [f"{prefix}episodes.csv", *videos]


@pytest.mark.parametrize("options", [{}, {"force": True}, {"resume": True}])
def test_each_of_several_has_a_directory_of_its_own(take, monitor_dir, options):
    play(take(ONE, **options), 0, 1)
    play(take(TWO, **options), 0)
    take(THREE, **options)
    assert files(monitor_dir) == sorted(of("", 0, 1) + of(TWO, 0) + of(THREE))


def test_force_removes_what_those_left_that_are_gone_and_nothing_of_the_living(take, monitor_dir):
    one, two = play(take(ONE), 0), play(take(TWO), 0, 1)
    play(take(THREE), 0).table.close()
    (three := monitor_dir / "run" / THREE / "notes.txt").write_text("mine")
    take("44444444", force=True)
    assert set(of("", 0) + of(TWO, 0, 1)) < set(files(monitor_dir))
    crash(one)
    five = take("55555555", force=True)
    assert five.path == monitor_dir / "run"
    kept = [*of(""), *of(TWO, 0, 1), f"{THREE}/notes.txt", *of("44444444")]
    assert files(monitor_dir) == sorted(kept)
    assert three.read_text() == "mine"
    crash(two)


def test_a_crash_before_the_table_was_begun_is_no_hindrance(take, monitor_dir):
    (monitor_dir / "run").mkdir()
    (monitor_dir / "run" / "episodes.csv").touch()
    assert take(ONE).path == monitor_dir / "run"


def test_what_is_left_behind_is_kept_unless_the_client_decides(take, monitor_dir):
    crash(play(take(ONE), 0))
    before = files(monitor_dir)
    with pytest.raises(GymServerError, match="earlier monitor"):
        take(TWO)
    assert files(monitor_dir) == before


def test_resume_goes_on_where_the_first_one_stopped(take):
    play(take(ONE), 0, 1, 2).table.close()
    assert take(TWO, resume=True).next_episode == 3
    assert take(THREE, resume=True).next_episode == 0


def test_resume_goes_on_with_ones_own_files(take, monitor_dir):
    one = take(ONE)
    play(take(TWO), 0, 1).table.close()
    one.table.close()
    again = take(TWO, resume=True)
    assert (again.path, again.next_episode) == (monitor_dir / "run" / TWO, 2)


HOLD = """
import sys
from pathlib import Path
from gym_server.monitoring.monitor_directory import take_directory
taken = take_directory(Path(sys.argv[1]), "run", "99999999", False, False)
taken.table.write("0,1.0,1,0.1\\n")
taken.table.flush()
print("ready", flush=True)
sys.stdin.read()
"""


def test_another_process_keeps_its_files_until_it_is_killed(take, monitor_dir):
    other = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(monitor_dir / "run")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    try:
        assert other.stdout.readline() == b"ready\n"
        assert take(ONE, force=True).path == monitor_dir / "run" / ONE
        table = monitor_dir / "run" / "episodes.csv"
        assert table.read_text().endswith("\n0,1.0,1,0.1\n")
    finally:
        other.kill()
        other.communicate()
    assert take(TWO, force=True).path == monitor_dir / "run"
    assert table.read_text() == "episode,return,length,seconds\n"


# Over HTTP ------------------------------------------------------------------------------------


def record(server, url, directory="agents", **fields):
    """Record an episode; return the directory of its table."""
    start = {"directory": directory, **fields}
    status, answer = server.post(f"{url}/monitor/start/", start)
    assert status == 204, answer
    server.post(f"{url}/reset/", {"seed": 0})
    while not server.post(f"{url}/step/", {"action": 1})[1]["done"]:
        pass
    return server.get(f"{url}/")[1]["monitor"]["directory"]


def test_six_agents_that_name_one_directory_all_record(serve, tmp_path):
    options = ("--monitor-dir", str(tmp_path))
    server = serve(*options)
    urls = [server.create("CartPole-v1") for _ in range(6)]
    directories = [record(server, url, force=True) for url in urls]
    agents = tmp_path / "agents"
    own = [str(agents / url.rsplit("/", 1)[1]) for url in urls[1:]]
    assert directories == [str(agents), *own]
    tables = sorted(agents.rglob("*"))
    assert len([one for one in tables if one.name == "episodes.csv"]) == 6
    assert all(len(one.read_text().splitlines()) == 2 for one in tables if one.is_file())

    server.kill()
    again = serve(*options)
    status, answer = again.post(
        f"{again.create('CartPole-v1')}/monitor/start/", {"directory": "agents"}
    )
    assert (status, answer["code"]) == (400, "monitor_directory")
    assert record(again, again.create("CartPole-v1"), force=True) == str(agents)
    assert [path.name for path in agents.iterdir()] == ["episodes.csv"]
