"""Processes as Linux lists them. For tests."""

import contextlib
import os
import shutil
import subprocess
from pathlib import Path


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
    """Return the descendants of a process."""
    children = {}
    for directory in Path("/proc").glob("[0-9]*"):
        # The process may have ended. The lists of children that Linux keeps may lack some.
        with contextlib.suppress(OSError):
            parent = int((directory / "stat").read_text().rpartition(")")[2].split()[1])
            children.setdefault(parent, []).append(int(directory.name))
    found = [pid]
    for one in found:
        found += children.get(one, [])
    return found[1:]


def r_has_the_package():
    """Return whether there is an R with this package."""
    rscript = shutil.which("Rscript")
    if rscript is None:
        return False
    asked = [rscript, "-e", "cat('env_watch' %in% getNamespaceExports('gym'))"]
    return subprocess.run(asked, capture_output=True, text=True, check=False).stdout == "TRUE"
