"""The files that one monitor writes: their names, and whether a monitor is writing them."""

from __future__ import annotations

import contextlib
import json
import os
import re
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import TextIO

from gym_server.errors import GymServerError
from gym_server.json_values import brief
from gym_server.monitoring.file_lock import try_lock

_MANIFEST = re.compile(r"gym-monitor(?:-([0-9a-f]{8}))?\.json")

# A greater number was not counted by a monitor, and names of files could become too long.
_MOST_EPISODES = 10**15


class MonitorFiles:
    """The files of one monitor in a directory that several may write.

    The first monitor there has the plain names, ``episodes.csv`` and so on.  The names of every
    further one, while others write there, carry its instance's id.

    A monitor that writes has the table locked. The system releases the lock when the process ends,
    so files whose table can be locked are those of a monitor that is gone.

    Attributes:
        path: the directory.
        table_name: the table of episodes.
        video_prefix: what the names of videos begin with.
        next_episode: the number of the episode that begins next.
        table: the table, open for appending, while these files are taken.
    """

    table: TextIO

    def __init__(self, path: Path, instance_id: str = "") -> None:
        """Name the files in a directory; ``take()`` takes them.

        Args:
            path: the directory.
            instance_id: the instance's, for the names that carry it.
        """
        suffix = f"-{instance_id}" if instance_id else ""
        self.path = path
        self.table_name = f"episodes{suffix}.csv"
        self.video_prefix = f"rl-video{suffix}"
        self._manifest = path / f"gym-monitor{suffix}.json"
        self.next_episode = 0
        self._listed: set[str] = set()
        self._deletes_table = False

    @property
    def were_written(self) -> bool:
        """Whether a monitor has written files of these names."""
        return self._manifest.exists()

    def video_name(self, episode: int) -> str:
        """Return the name of an episode's video, as Gymnasium's RecordVideo has it."""
        return f"{self.video_prefix}-episode-{episode}.mp4"

    # Taking and leaving ---------------------------------------------------------------------

    def take(self) -> bool:
        """Take these files, unless a living monitor has them; they may be there or not.

        Raises:
            OSError: the table cannot be opened or locked.
        """
        path = self.path / self.table_name
        while True:
            self._deletes_table = not path.exists()
            table = _open_locked(path)
            if table is None:
                return False
            if _is_at(table, path):
                self.table = table
                return True
            # The monitor that had it deleted it after it was opened here.
            table.close()

    def leave(self) -> None:
        """Give the files back as they were; see also ``delete()``."""
        if self._deletes_table:
            self._delete_table()
        self.table.close()

    def release(self) -> None:
        """Write the list of these files for a later monitor, and give them back."""
        try:
            self._write_manifest()
        finally:
            self.table.close()

    # While they are taken -------------------------------------------------------------------

    def read_manifest(self) -> None:
        """Read what an earlier monitor wrote, and where it stopped counting.

        Raises:
            GymServerError: ``monitor_directory``.
        """
        reading = self._manifest.name
        try:
            manifest = json.loads(self._manifest.read_text(encoding="utf-8"))
            self._listed = {str(name) for name in manifest["files"]}
            self.next_episode = _episode(manifest["next_episode"])
            reading = self.table_name
            # A server that was killed did not write the last number.
            self.next_episode = max([self.next_episode, *self._episodes_in_table()])
        except FileNotFoundError:
            return
        except (
            OSError,
            ValueError,
            ArithmeticError,
            LookupError,
            TypeError,
            RecursionError,
        ) as error:
            raise refuse(
                self.path,
                f"{reading} is damaged: {error}",
                "mend that file, or move it and the other files of its monitor away, or take "
                "another directory",
            ) from error

    def left_behind(self) -> set[str]:
        """Return the names of the files there that earlier monitors wrote."""
        return self._present() & self._listed

    def check(self) -> None:
        """Refuse to write where files of these names are not ours.

        Raises:
            GymServerError: ``monitor_directory``.
        """
        present = self._present()
        foreign = present - self._listed
        if foreign:
            raise refuse(
                self.path,
                f"it holds {min(foreign)}, which no monitor of this server wrote",
                "move that file away, or take another directory",
            )
        for name in present | {self.table_name}:
            if not stat.S_ISREG((self.path / name).lstat().st_mode):
                raise refuse(self.path, f"{name} is no ordinary file")

    def empty(self) -> None:
        """Delete what an earlier monitor wrote, and begin to count anew."""
        for name in self.left_behind() - {self.table_name}:
            (self.path / name).unlink()
        self.table.truncate(0)
        self._listed.clear()
        self.next_episode = 0

    def delete(self) -> None:
        """Delete what an earlier monitor wrote; its table goes when they are left."""
        names = self.left_behind()
        for name in names - {self.table_name}:
            (self.path / name).unlink()
        self._manifest.unlink(missing_ok=True)
        self._deletes_table |= self.table_name in names or not self._table_size()

    def begin(self, columns: Iterable[str]) -> None:
        """Begin to write: list the table, and give a new one its header."""
        self.add(self.table_name)
        if not self._table_size():
            self.table.write(",".join(columns) + "\n")
            self.table.flush()

    def add(self, name: str) -> None:
        """Put a file on the list, before it is written."""
        self._listed.add(name)
        self._write_manifest()

    def _present(self) -> set[str]:
        # Whatever the list says, a monitor writes and deletes files of these names only.
        video = re.compile(rf"{self.video_prefix}-episode-\d+\.mp4")
        names = {name for name in os.listdir(self.path) if video.fullmatch(name)}
        # An empty table has no data: take() creates one before it is known what else is there.
        return names | {self.table_name} if self._table_size() else names

    def _table_size(self) -> int:
        return os.fstat(self.table.fileno()).st_size

    def _delete_table(self) -> None:
        # While it is locked, so that no other monitor has it; Windows deletes no open file.
        if os.name == "nt":
            self.table.close()
        (self.path / self.table_name).unlink(missing_ok=True)

    def _episodes_in_table(self) -> list[int]:
        lines = (self.path / self.table_name).read_text(encoding="ascii").splitlines()[1:]
        return [_episode(line.split(",")[0]) + 1 for line in lines if line]

    def _write_manifest(self) -> None:
        if not _is_at(self.table, self.path / self.table_name):
            # Another monitor may be writing under these names by now.
            raise FileNotFoundError(f"{self.table_name} was taken away")
        manifest = {
            "written_by": "gym_server",
            "next_episode": self.next_episode,
            "files": sorted(self._listed),
        }
        new = self._manifest.with_name(f"{self._manifest.name}.new")
        # A new file, so that no link of that name is followed.
        new.unlink(missing_ok=True)
        with open(new, "x", encoding="utf-8") as file:
            json.dump(manifest, file, indent=1)
        new.replace(self._manifest)


def _episode(number: str | float) -> int:
    """Read an episode's number from a file."""
    episode = int(number)
    if not 0 <= episode <= _MOST_EPISODES:
        raise ValueError(f"{number} is no episode's number")
    return episode


def files_in(path: Path) -> list[MonitorFiles]:
    """Return the files of every monitor that has written in a directory."""
    found = sorted(filter(None, map(_MANIFEST.fullmatch, os.listdir(path))), key=str)
    return [MonitorFiles(path, match[1] or "") for match in found]


def refuse(directory: object, reason: str, hint: str | None = None) -> GymServerError:
    """A directory cannot be used by a monitor."""
    return GymServerError(
        "monitor_directory",
        f"The directory {brief(str(directory))} cannot be used: {reason}",
        hint or "name a directory relative to the server's --monitor-dir, such as 'cartpole-1'",
    )


def _open_locked(path: Path) -> TextIO | None:
    """Open a table for appending and lock it; return None where another has it locked."""
    with contextlib.ExitStack() as undo:
        table = undo.enter_context(
            open(path, "a", encoding="ascii", newline="", opener=_open_no_link)
        )
        if not try_lock(table):
            return None
        undo.pop_all()
    return table


def _open_no_link(path: str, flags: int) -> int:
    # Follow no link, and do not wait for a reader of a pipe of that name.
    careful = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    return os.open(path, flags | careful, 0o666)


def _is_at(file: TextIO, path: Path) -> bool:
    """Tell whether an open file is the one at a path."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), os.stat(path))
    except FileNotFoundError:
        return False
