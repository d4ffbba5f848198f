"""Processes as Linux lists them."""

import contextlib
import os
import shutil
import subprocess
from pathlib import Path


def is_running(pid):
    try:
        os.kill(pid, 0)
        # A process that has ended and that nobody has waited for is still listed.
        return _state(Path(f"/proc/{pid}")) != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False


def is_stopped(pid):
    """Tell whether a signal has stopped all threads of a process; the last one stops later."""
    return all(_state(task) == "T" for task in Path(f"/proc/{pid}/task").iterdir())


def _state(directory):
    return (directory / "stat").read_text().rpartition(")")[2].split()[0]


def descendants(pid):
    stats = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        # It may end while it is looked at.
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):
            stats.append(stat.read_text())
    # The number, the name in parentheses, the state, the parent's number.
    parents = {int(one.split()[0]): int(one.rpartition(")")[2].split()[1]) for one in stats}
    found = [pid]
    for parent in found:
        found += [child for child, its_parent in parents.items() if its_parent == parent]
    return found[1:]


def r_has_the_package():
    """Tell whether there is an R with this package in it."""
    rscript = shutil.which("Rscript")
    if rscript is None:
        return False
    asked = [rscript, "-e", "cat('env_watch' %in% getNamespaceExports('gym'))"]
    return subprocess.run(asked, capture_output=True, text=True, check=False).stdout == "TRUE"
