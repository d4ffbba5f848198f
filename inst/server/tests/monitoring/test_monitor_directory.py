import os
import tempfile
from pathlib import Path

import pytest

from gym_server.errors import GymServerError
from gym_server.monitoring.monitor_directory import MonitorRoot, take_directory


@pytest.fixture
def root(monitor_dir):
    return MonitorRoot(monitor_dir, allow_temporary=False)


@pytest.fixture(autouse=True)
def taken():
    """Release at the end what a test has taken."""
    TAKEN.clear()
    yield
    for directory in TAKEN:
        directory.table.close()


TAKEN = []


def take(root, directory, force=False, resume=False, instance_id="0123abcd"):
    name = str(directory)
    TAKEN.append(take_directory(root.resolve(name), name, instance_id, force, resume))
    return TAKEN[-1]


def refused(root, directory, **options):
    with pytest.raises(GymServerError) as caught:
        take(root, directory, **options)
    assert caught.value.code == "monitor_directory"
    assert caught.value.hint
    return caught.value.message


def fill(root, directory="run", episodes=(0,), videos=()):
    taken = take(root, directory, resume=True)
    for number in episodes:
        taken.table.write(f"{number},1.0,1,0.1\n")
    for number in videos:
        (taken.path / f"rl-video-episode-{number}.mp4").write_text("video")
    taken.table.close()
    return taken.path


HEADER = "episode,return,length,seconds\n"


def test_a_relative_directory_lies_below_the_root(root, monitor_dir):
    assert take(root, "a/b").path == monitor_dir / "a" / "b"
    assert (monitor_dir / "a" / "b").is_dir()


def test_an_absolute_directory_may_lie_below_the_root(root, monitor_dir):
    assert take(root, monitor_dir / "run").path == monitor_dir / "run"


@pytest.mark.parametrize(
    "directory",
    ["..", "../run", "a/../../run", "a/..", "/etc/gym", "a\0b", ".", "/"],
)
def test_any_other_directory_is_refused(root, directory, tmp_path):
    before = sorted(tmp_path.rglob("*"))
    refused(root, directory)
    assert sorted(tmp_path.rglob("*")) == before


def test_a_sibling_whose_name_begins_alike_is_refused(root, monitor_dir):
    refused(root, f"{monitor_dir}-other/run")


def test_the_temporary_directory_is_only_allowed_where_it_is_said(monitor_dir, root):
    with tempfile.TemporaryDirectory() as directory:
        refused(root, Path(directory, "run"))
        trusting = MonitorRoot(monitor_dir, allow_temporary=True)
        assert take(trusting, Path(directory, "run")).path.is_dir()


@pytest.mark.skipif(os.name != "posix", reason="the classic examples' path")
def test_the_classic_examples_directory_is_accepted(monitor_dir):
    trusting = MonitorRoot(monitor_dir, allow_temporary=True)
    with tempfile.TemporaryDirectory(dir="/tmp") as directory:
        assert take(trusting, f"{directory}/random-agent-results").path.is_dir()
    refused(trusting, "/tmp")
    refused(trusting, "/tmp/../etc/gym")


@pytest.mark.skipif(os.name != "posix", reason="links")
def test_a_link_that_leads_out_is_refused(root, monitor_dir, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (monitor_dir / "link").symlink_to(tmp_path / "elsewhere")
    refused(root, "link")
    refused(root, "link/run")
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_a_file_in_the_way_is_refused(root, monitor_dir):
    (monitor_dir / "run").write_text("a file")
    refused(root, "run")
    refused(root, "run/deeper")


def test_the_files_of_an_earlier_monitor_are_kept_unless_the_client_decides(root):
    path = fill(root)
    assert "earlier monitor" in refused(root, "run")
    assert (path / "episodes.csv").read_text() == HEADER + "0,1.0,1,0.1\n"


def test_resume_goes_on_counting(root):
    fill(root, episodes=[0, 1, 3])
    taken = take(root, "run", resume=True)
    assert taken.next_episode == 4
    taken.table.close()
    assert take(root, "run", resume=True).next_episode == 4


def test_resume_counts_an_episode_of_which_there_is_a_video_only(root):
    fill(root, episodes=[0], videos=[0, 2])
    assert take(root, "run", resume=True).next_episode == 3


def test_resuming_nothing_begins_at_0(root):
    assert take(root, "run", resume=True).next_episode == 0


def test_force_deletes_what_monitors_wrote_and_nothing_else(root):
    path = fill(root, videos=[0])
    for name in ("notes.txt", "my-episodes.csv", "holiday.mp4"):
        (path / name).write_text("mine")
    taken = take(root, "run", force=True)
    assert taken.next_episode == 0
    assert sorted(os.listdir(path)) == [
        "episodes.csv",
        "holiday.mp4",
        "my-episodes.csv",
        "notes.txt",
    ]


@pytest.mark.parametrize("name", ["episodes.csv", "rl-video-episode-3.mp4"])
@pytest.mark.parametrize("options", [{}, {"force": True}, {"resume": True}])
def test_a_file_of_that_name_from_elsewhere_is_never_touched(root, monitor_dir, name, options):
    (monitor_dir / "run").mkdir()
    (monitor_dir / "run" / name).write_text("mine")
    assert name in refused(root, "run", **options)
    assert (monitor_dir / "run" / name).read_text() == "mine"
    assert os.listdir(monitor_dir / "run") == [name]


def test_a_table_that_only_looks_like_one_protects_what_lies_beside_it(root, monitor_dir):
    (monitor_dir / "run").mkdir()
    (monitor_dir / "run" / "episodes.csv").write_text("episode,return\n0,1\n")
    (monitor_dir / "run" / "rl-video-episode-0.mp4").write_text("mine")
    assert "episodes.csv" in refused(root, "run", force=True)
    assert (monitor_dir / "run" / "rl-video-episode-0.mp4").read_text() == "mine"


@pytest.mark.parametrize("row", ["\u00e9pisode", "one,2", "-5", "9" * 5000, "\0"])
def test_a_damaged_table_is_refused(root, row):
    path = fill(root)
    (path / "episodes.csv").write_text(f"{HEADER}{row}\n", encoding="utf-8")
    assert "episodes.csv is damaged" in refused(root, "run", resume=True)


def test_a_directory_that_was_refused_is_free_again(root, monitor_dir):
    (monitor_dir / "run").mkdir()
    (monitor_dir / "run" / "episodes.csv").write_text("mine")
    refused(root, "run")
    (monitor_dir / "run" / "episodes.csv").unlink()
    take(root, "run")
