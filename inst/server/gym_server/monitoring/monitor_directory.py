"""Directories for monitors: which are allowed, and their contents."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import sys
import tempfile
import threading
from pathlib import Path
from typing import TextIO

from gym_server.errors import GymServerError
from gym_server.json_values import brief

TABLE = "episodes.csv"
_HEADER = "episode,return,length,seconds\n"

# The subdirectory of a monitor that shares its directory with another one.
_INSTANCE_ID = re.compile("[0-9a-f]{8}")

# The names of Gymnasium's RecordVideo.
_VIDEO = re.compile(r"rl-video-episode-(\d+)\.mp4")


class MonitorRoot:
    """The directories that a server's monitors may write to."""

    def __init__(self, root: Path | None, allow_temporary: bool) -> None:
        """Set the limits.

        Args:
            root: the parent of relative directories, and of allowed absolute ones; None for a
                temporary directory, created when the first monitor starts.
            allow_temporary: whether absolute ones may also be below the system's temporary
                directory, as in the classic examples.
        """
        self._root = root
        self._own_root: Path | None = None
        self._allowed: list[Path] = []
        if allow_temporary:
            self._allowed.append(Path(tempfile.gettempdir()))
            if os.name == "posix":
                self._allowed.append(Path("/tmp"))
        self._lock = threading.Lock()

    def resolve(self, directory: str) -> Path:
        """Return the path of a directory that a client names, for ``take_directory()``.

        Raises:
            GymServerError: ``monitor_directory`` if monitors may not write there.
        """
        if ".." in Path(directory).parts:
            raise _refuse(directory, "it contains '..'")
        try:
            # Resolve links before comparing, so that none leads outside.
            own = self._find_root()
            path = Path(own, directory).resolve()
            allowed = [root.resolve() for root in (own, *self._allowed)]
        except (OSError, RuntimeError, ValueError) as error:
            raise _refuse(directory, str(error)) from error
        if not any(root in path.parents for root in allowed):
            raise _refuse(directory, "it is outside the directory that this server may write to")
        return path

    def close(self) -> None:
        """Remove the temporary directory if it is empty."""
        if self._own_root is not None:
            with contextlib.suppress(OSError):
                self._own_root.rmdir()

    def _find_root(self) -> Path:
        with self._lock:
            if self._root is None:
                self._root = self._own_root = Path(tempfile.mkdtemp(prefix="gym-monitor-"))
            return self._root


class MonitorDirectory:
    """The directory of one monitor, with its table and videos.

    An active monitor locks the table. The system releases the lock when the process ends, so a
    directory whose table can be locked belongs to a monitor that has ended.

    Attributes:
        path: the directory.
        next_episode: the number of the next episode.
        table: the table, open for appending.
        is_free: whether no active monitor had it.
    """

    def __init__(self, path: Path) -> None:
        """Open the directory's table, and lock it.

        Raises:
            OSError: the table cannot be opened or locked.
        """
        path.mkdir(parents=True, exist_ok=True)
        self.path = path
        self.next_episode = 0
        self.table: TextIO = open(  # noqa: SIM115
            path / TABLE, "a+", encoding="ascii", errors="replace", newline=""
        )
        try:
            self.is_free = _try_lock(self.table)
        except OSError:
            self.leave()
            raise

    def leave(self) -> None:
        """Leave the directory as it was."""
        is_empty = not self._size
        self.table.close()
        if is_empty:
            (self.path / TABLE).unlink(missing_ok=True)

    def prepare(self, force: bool, resume: bool) -> None:
        """Keep, delete or refuse an earlier monitor's files; then start the table.

        Raises:
            OSError: something cannot be read, written or deleted.
            GymServerError: ``monitor_directory``.
        """
        if force:
            self.empty()
        videos = self.videos()
        if self._size and not resume:
            raise _refuse(
                self.path,
                "it holds the files of an earlier monitor",
                "use force = true to delete them, or resume = true to continue the numbering",
            )
        elif self._size:
            numbers = [int(number) for number in videos.values()] + self._episodes()
            self.next_episode = max((number + 1 for number in numbers), default=0)
        if not self._size:
            self.table.write(_HEADER)
            self.table.flush()

    def empty(self) -> None:
        """Delete the files of a monitor that has ended."""
        for name in self.videos():
            (self.path / name).unlink()
        self.table.truncate(0)

    def videos(self) -> dict[str, str]:
        """Return the names of earlier videos, each with its episode's number.

        Raises:
            GymServerError: ``monitor_directory`` if files with these names are not a monitor's.
        """
        found = {
            match[0]: match[1] for match in map(_VIDEO.fullmatch, os.listdir(self.path)) if match
        }
        self.table.seek(0)
        is_ours = self._size > 0 and self.table.readline() == _HEADER
        foreign = [TABLE] * (self._size > 0) + sorted(found)
        if foreign and not is_ours:
            raise _refuse(
                self.path,
                f"it holds {foreign[0]}, which no monitor of this server wrote",
                "move that file away, or use another directory",
            )
        return found

    @property
    def _size(self) -> int:
        return os.fstat(self.table.fileno()).st_size

    def _episodes(self) -> list[int]:
        """Return the episode numbers in the table, whose header was already read."""
        try:
            numbers = [int(line.split(",")[0]) for line in self.table.read().splitlines() if line]
            if min(numbers, default=0) < 0:
                raise ValueError("it holds a value that is not an episode's number")
        except ValueError as error:
            raise _refuse(
                self.path,
                f"{TABLE} is damaged: {error}",
                "repair that file, or move it away, or use another directory",
            ) from error
        return numbers


def take_directory(
    path: Path, directory: str, instance_id: str, force: bool, resume: bool
) -> MonitorDirectory:
    """Give a monitor its own directory.

    Args:
        path: the result of ``MonitorRoot.resolve()``.
        directory: its name as the client sent it.
        instance_id: the recorded instance. While another monitor writes to the directory, this one
            uses a subdirectory with this name.
        force: delete the files of monitors that have ended.
        resume: keep these files, and continue the numbering. ``force`` takes precedence.

    Raises:
        GymServerError: ``monitor_directory``.
    """
    own = path / instance_id
    # An instance continues in its own subdirectory if it has one.
    places = (own, path) if resume and not force and own.exists() else (path, own)
    try:
        for place in places:
            taken = MonitorDirectory(place)
            if taken.is_free:
                break
            taken.table.close()
        else:
            raise _refuse(path, "another monitor writes there")
        try:
            taken.prepare(force, resume)
            if force and taken.path == path:
                _empty_those_of_gone_monitors(path)
        except BaseException:
            taken.leave()
            raise
    except OSError as error:
        raise _refuse(directory, error.strerror or str(error)) from error
    return taken


def _empty_those_of_gone_monitors(path: Path) -> None:
    for table in path.glob(f"*/{TABLE}"):
        if _INSTANCE_ID.fullmatch(table.parent.name):
            other = MonitorDirectory(table.parent)
            if not other.is_free:
                other.table.close()
                continue
            other.empty()
            other.leave()
            with contextlib.suppress(OSError):
                other.path.rmdir()


def _refuse(directory: object, reason: str, hint: str | None = None) -> GymServerError:
    """Report a directory that a monitor cannot use."""
    return GymServerError(
        "monitor_directory",
        f"The directory {brief(str(directory))} cannot be used: {reason}",
        hint or "name a directory relative to the server's --monitor-dir, such as 'cartpole-1'",
    )


if sys.platform == "win32":
    import msvcrt

    # Windows prevents others from reading a locked part, so lock one far behind the file's end.
    _FAR_BEHIND = 2**30

    def _lock(descriptor: int) -> None:
        os.lseek(descriptor, _FAR_BEHIND, os.SEEK_SET)
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        finally:
            os.lseek(descriptor, 0, os.SEEK_END)

else:
    import fcntl

    def _lock(descriptor: int) -> None:
        # lockf() locks belong to the process, which could take one twice, and they end when any
        # other handle of the file is closed.
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _try_lock(file: TextIO) -> bool:
    """Lock an open file until it is closed; return False if it is already locked.

    Raises:
        OSError: the file system does not support locks.
    """
    try:
        _lock(file.fileno())
    except OSError as error:
        if error.errno in (errno.EWOULDBLOCK, errno.EACCES, errno.EDEADLK):
            return False
        raise
    return True
