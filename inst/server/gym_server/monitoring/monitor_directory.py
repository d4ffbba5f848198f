"""Directories that monitors write: which are allowed, and which files a monitor gets there."""

from __future__ import annotations

import contextlib
import math
import os
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path, PurePosixPath, PureWindowsPath

from gym_server.monitoring.disk_use import DiskUse
from gym_server.monitoring.monitor_files import MonitorFiles, files_in, refuse


class MonitorRoot:
    """Where the monitors of a server may write.

    Attributes:
        disk_use: how much they have written, and may write.
    """

    def __init__(
        self, root: Path | None, allow_temporary: bool, most_bytes: float = math.inf
    ) -> None:
        """Set the limits.

        Args:
            root: relative directories lie below it, and absolute ones may; None for a temporary
                directory, created when the first monitor starts.
            allow_temporary: whether absolute ones may also lie below the system's temporary
                directory, as the classic examples have it.
            most_bytes: what all of them together may write.
        """
        self.disk_use = DiskUse(most_bytes)
        self._root = root
        self._own_root: Path | None = None
        self._allowed: list[Path] = []
        if allow_temporary:
            self._allowed.append(Path(tempfile.gettempdir()))
            if os.name == "posix":
                self._allowed.append(Path("/tmp"))
        self._lock = threading.Lock()

    def claim(self, directory: str, instance_id: str, force: bool, resume: bool) -> MonitorFiles:
        """Give one monitor files of its own in a directory.

        Args:
            directory: as the client names it.
            instance_id: the recorded instance's, for the names of its files while another
                monitor has the plain ones.
            force: delete what monitors left there that are gone.
            resume: keep it, and go on counting; ``force`` goes first.

        Raises:
            GymServerError: ``monitor_directory``.
        """
        return claim(self.resolve(directory), directory, instance_id, force, resume)

    def resolve(self, directory: str) -> Path:
        """Return where a directory is, for ``claim()``.

        Raises:
            GymServerError: ``monitor_directory`` for one that monitors may not write.
        """
        if "\0" in directory:
            raise refuse(directory, "it contains a NUL")
        if ".." in PurePosixPath(directory).parts or ".." in PureWindowsPath(directory).parts:
            raise refuse(directory, "it climbs")
        try:
            # Links are followed before the comparison, so that none leads out.
            own = self._find_root()
            path = Path(own, directory).resolve()
            allowed = [root.resolve() for root in (own, *self._allowed)]
        except (OSError, RuntimeError, ValueError) as error:
            raise refuse(directory, str(error)) from error
        if not any(root in path.parents for root in allowed):
            raise refuse(directory, "it is outside the directory that this server may write")
        return path

    def close(self) -> None:
        """Remove the temporary directory unless something was written there."""
        if self._own_root is not None:
            with contextlib.suppress(OSError):
                self._own_root.rmdir()

    def _find_root(self) -> Path:
        with self._lock:
            if self._root is None:
                self._root = self._own_root = Path(tempfile.mkdtemp(prefix="gym-monitor-"))
            return self._root


def claim(path: Path, directory: str, instance_id: str, force: bool, resume: bool) -> MonitorFiles:
    """Give one monitor files of its own in a resolved directory; see ``MonitorRoot.claim()``."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        if path.resolve() != path:
            raise refuse(directory, "it leads elsewhere")
        files = _take(path, instance_id, resume and not force)
        try:
            _prepare(files, force, resume)
        except BaseException:
            files.leave()
            raise
    except OSError as error:
        raise refuse(directory, error.strerror or str(error)) from error
    return files


def _take(path: Path, instance_id: str, resume: bool) -> MonitorFiles:
    plain, own = MonitorFiles(path), MonitorFiles(path, instance_id)
    # An instance goes on with what it began under its own name.
    for files in (own, plain) if resume and own.were_written else (plain, own):
        if files.take():
            return files
    raise refuse(path, "another monitor writes there")


def _prepare(files: MonitorFiles, force: bool, resume: bool) -> None:
    """Keep what earlier monitors left, delete it or refuse."""
    files.read_manifest()
    files.check()
    others = [other for other in files_in(files.path) if other.table_name != files.table_name]
    if force:
        for other in others:
            _delete_if_gone(other)
        files.empty()
    elif not resume and (files.left_behind() or any(map(_is_left_behind, others))):
        raise refuse(
            files.path,
            "it holds the files of an earlier monitor",
            "take force = true to delete them, or resume = true to go on counting",
        )


def _delete_if_gone(files: MonitorFiles) -> None:
    with _taken_if_gone(files) as is_gone:
        if is_gone:
            files.delete()


def _is_left_behind(files: MonitorFiles) -> bool:
    with _taken_if_gone(files) as is_gone:
        return is_gone and bool(files.left_behind())


@contextlib.contextmanager
def _taken_if_gone(files: MonitorFiles) -> Iterator[bool]:
    """Take the files of another monitor for a moment; yield whether it is gone."""
    is_gone = files.take()
    try:
        if is_gone:
            files.read_manifest()
        yield is_gone
    finally:
        if is_gone:
            files.leave()
