"""The working directories of the users' servers, and the accounts that they run under."""

from __future__ import annotations

import contextlib
import os
import subprocess
import tempfile
from pathlib import Path

from gym_server.front.python import command, environment

# The numbers that systemd gives to passing services; no account of the machine has them.
_UIDS = range(61184, 65520)


class Folders:
    """Makes the folders, below one.

    Attributes:
        separate: whether each folder, and the server that works in it, has a uid of its own.
    """

    def __init__(self, base: Path | None) -> None:
        """Decide whether users get uids of their own.

        Args:
            base: the folder of all users' folders; None for a temporary one.

        Raises:
            OSError: it cannot be made.
        """
        self.separate = os.geteuid() == 0 and _can_serve(_UIDS[-1])
        self._is_temporary = base is None
        self._base = Path(tempfile.mkdtemp(prefix="gym-users-")) if base is None else base.resolve()
        self._base.mkdir(parents=True, exist_ok=True)
        if self.separate:
            # Each user reaches their own folder, and cannot list the others.
            self._base.chmod(0o711)

    def of(self, name: str) -> tuple[Path, int | None]:
        """Return a user's folder, and the uid of the server that works in it, or None.

        The uid is the folder's owner, so it is the same after a restart, and an operator can choose
        it with ``chown``.
        """
        folder = self._base / name
        folder.mkdir(mode=0o700, exist_ok=True)
        if not self.separate:
            return folder, None
        if folder.stat().st_uid == 0:
            taken = {other.stat().st_uid for other in self._base.iterdir()}
            uid = next(uid for uid in _UIDS if uid not in taken)
            os.chown(folder, uid, uid)
        return folder, folder.stat().st_uid

    def close(self) -> None:
        """Remove temporary folders that hold nothing."""
        if self._is_temporary:
            for folder in (*self._base.iterdir(), self._base):
                with contextlib.suppress(OSError):
                    folder.rmdir()


def _can_serve(uid: int) -> bool:
    """Return whether another account can run a server; Python may be in somebody's home."""
    try:
        done = subprocess.run(
            command("--version"),
            env=environment(),
            cwd="/",
            user=uid,
            group=uid,
            extra_groups=[],
            stdin=subprocess.DEVNULL,
            capture_output=True,
        )
    except OSError:
        return False
    return done.returncode == 0
