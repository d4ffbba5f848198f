"""Processes as Linux lists them. For tests."""

import os
import shutil
import subprocess
from pathlib import Path

from gym_server.processes import memory


def is_running(pid):
    try:
        os.kill(pid, 0)
        # A process that has ended stays listed until its parent waits for it.
        return _state(Path(f"/proc/{pid}")) != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False


def is_stopped(pid):
    """Return whether a signal has stopped all threads of a process; the last one stops later."""
    return all(_state(task) == "T" for task in Path(f"/proc/{pid}/task").iterdir())


def _state(directory):
    return (directory / "stat").read_text().rpartition(")")[2].split()[0]


def descendants(pid):
    return list(memory.descendants(pid))


def r_has_the_package():
    """Return whether there is an R with this package."""
    rscript = shutil.which("Rscript")
    if rscript is None:
        return False
    asked = [rscript, "-e", "cat('env_watch' %in% getNamespaceExports('gym'))"]
    return subprocess.run(asked, capture_output=True, text=True, check=False).stdout == "TRUE"
