import os
import shutil
import stat
import subprocess
import tempfile
from pathlib import Path

import pytest
from front_process import FrontProcess

from gym_server.front import folders
from gym_server.front.folders import Folders


def test_each_user_has_a_folder_that_is_there_again(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    made = Folders(tmp_path / "runs")
    folder, uid = made.of("anna")
    assert made.of("anna") == (folder, uid) == (tmp_path / "runs" / "anna", None)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_a_temporary_folder_stays_only_for_what_was_written(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    made = Folders(None)
    folders_of = {name: made.of(name)[0] for name in ("anna", "ben")}
    (folders_of["anna"] / "runs").touch()
    made.close()
    assert folders_of["anna"].exists() and not folders_of["ben"].exists()
    (folders_of["anna"] / "runs").unlink()
    made.close()
    assert not folders_of["anna"].parent.exists()


needs_root = pytest.mark.skipif(
    os.name != "posix" or os.geteuid() != 0, reason="only root gives away folders"
)


@needs_root
def test_each_folder_has_an_owner_of_its_own_and_keeps_it(tmp_path, monkeypatch):
    monkeypatch.setattr(folders, "_can_serve", lambda uid: True)
    made = Folders(tmp_path)
    uids = {name: made.of(name)[1] for name in ("anna", "ben")}
    assert len(set(uids.values())) == 2 and 0 not in uids.values()
    os.chown(tmp_path / "ben", 12345, 12345)
    # After a restart, too, and as the operator has chosen.
    assert Folders(tmp_path).of("anna") == (tmp_path / "anna", uids["anna"])
    assert Folders(tmp_path).of("ben")[1] == 12345


@needs_root
@pytest.mark.slow
def test_each_server_runs_under_the_account_of_its_folder(tmp_path):
    if not folders._can_serve(61184):
        pytest.skip("other accounts cannot run this Python")
    # Other accounts do not reach pytest's folders.
    runs = tempfile.mkdtemp(prefix="gym-test-")
    options = ("--allow-module", "faulty_envs", "--monitor-dir", runs)
    front = FrontProcess(tmp_path, *options, stderr=subprocess.DEVNULL)
    try:
        pids = {name: front.pid_of(name) for name in ("anna", "ben")}
        uids = {name: Path(f"/proc/{pid}").stat().st_uid for name, pid in pids.items()}
        assert len({0, *uids.values()}) == 3
        assert front.make("anna", "faulty_envs:Counting-v0")
        where = {name: os.readlink(f"/proc/{pid}/cwd") for name, pid in pids.items()}
        assert {name: os.stat(place).st_uid for name, place in where.items()} == uids
        environ = Path(f"/proc/{pids['ben']}/environ")
        code = f"import os; os.setuid({uids['anna']}); open('{environ}').read()"
        # Anna's processes can read neither Ben's token nor his folder.
        for said in (code, code.replace(str(environ), f"{where['ben']}/x")):
            done = subprocess.run(["/usr/bin/python3", "-c", said], capture_output=True, text=True)
            assert "PermissionError" in done.stderr
    finally:
        assert front.stop()[0] == 0
        front.kill()
        shutil.rmtree(runs)
