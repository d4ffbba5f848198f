"""How many files and connections this process may have open."""

from __future__ import annotations

import contextlib

# More than the server's connections, and its environments' pipes and files. No higher, because some
# programs close every possible file when they start.
_ENOUGH = 65536

# The limit that macOS enforces, whatever it reports.
_LEAST = 10240


def allow_many_open_files() -> None:
    """Raise the limit of open files, which is 1,024 on many systems, as far as allowed.

    Windows has no such limit.
    """
    try:
        import resource
    except ImportError:
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    for most in (_ENOUGH, _LEAST):
        wanted = most if hard == resource.RLIM_INFINITY else min(most, hard)
        if soft == resource.RLIM_INFINITY or soft >= wanted:
            return
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
            return
