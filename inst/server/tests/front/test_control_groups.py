import signal
import subprocess
import sys
from pathlib import Path

import pytest
from front_process import FrontProcess

pytestmark = pytest.mark.slow

MOUNT = Path("/sys/fs/cgroup")


def group_of(pid):
    lines = Path(f"/proc/{pid}/cgroup").read_text().splitlines()
    (own,) = (line.removeprefix("0::/") for line in lines if line.startswith("0::"))
    return MOUNT / own


@pytest.fixture
def grouped(tmp_path):
    """Return a front with control groups."""
    with open(tmp_path / "log", "w") as log:
        front = FrontProcess(tmp_path, "--max-memory-mb", "400", stderr=log)
    if front.port is None or "There are no cgroups" in (tmp_path / "log").read_text():
        front.kill()
        pytest.skip("this system has no control groups for us")
    yield front
    front.kill()


def test_each_server_has_a_group_with_limits_and_a_greedy_one_ends_nobody_else(grouped):
    groups = {name: group_of(grouped.pid_of(name)) for name in ("anna", "ben")}
    assert groups["anna"] != groups["ben"] != group_of(grouped.process.pid)
    for group in groups.values():
        read = {name: int((group / name).read_text()) for name in ("memory.max", "cpu.weight")}
        assert read == {"memory.max": 400 * 2**20, "cpu.weight": 100}
        assert int((group / "pids.max").read_text()) > 1000
    pid = grouped.pid_of("ben")
    code = f"open('{groups['anna']}/cgroup.procs', 'w').write('0'); bytearray(2**29)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == -signal.SIGKILL
    assert grouped.pid_of("ben") == pid
    assert grouped.stop()[0] == 0
    assert not groups["anna"].parent.exists()
