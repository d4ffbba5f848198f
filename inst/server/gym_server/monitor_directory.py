"""Directories that monitors write: which are allowed, and which files in them are ours."""

from __future__ import annotations

import contextlib
import json
import os
import re
import tempfile
import threading
from collections.abc import Callable, Iterable
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import TextIO

from gym_server.errors import GymServerError
from gym_server.plain import brief

EPISODES = "episodes.csv"
MANIFEST = "gym-monitor.json"

_VIDEO = re.compile(r"rl-video-episode-(\d+)\.mp4")


def video_name(episode: int) -> str:
    """Return the name that RecordVideo gives the video of an episode."""
    return f"rl-video-episode-{episode}.mp4"


class MonitorRoot:
    """Where the monitors of a server may write."""

    def __init__(self, root: Path | None, allow_temporary: bool) -> None:
        """Set the limits.

        Args:
            root: relative directories lie below it, and absolute ones may; None for a temporary
                directory, made when the first monitor starts.
            allow_temporary: whether absolute ones may also lie below the system's temporary
                directory, as the classic examples have it.
        """
        self._root = root
        self._own_root: Path | None = None
        self._allowed: list[Path] = []
        if allow_temporary:
            self._allowed.append(Path(tempfile.gettempdir()))
            if os.name == "posix":
                self._allowed.append(Path("/tmp"))
        self._lock = threading.Lock()
        self._in_use: set[Path] = set()

    def claim(self, directory: str, force: bool, resume: bool) -> MonitorDirectory:
        """Make a directory ready for one monitor, and refuse it to all others.

        Args:
            directory: as the client names it.
            force: delete the files that an earlier monitor wrote there.
            resume: keep them and go on counting; ``force`` goes first.

        Raises:
            GymServerError: ``monitor_directory``.
        """
        return claim(self.reserve(directory), directory, force, resume, self.release)

    def reserve(self, directory: str) -> Path:
        """Refuse a directory to all monitors but one, which may ``claim()`` it.

        Args:
            directory: as the client names it.

        Returns:
            Where it is; to be given to ``release()`` in the end.

        Raises:
            GymServerError: ``monitor_directory``.
        """
        path = self._resolve(directory)
        with self._lock:
            if path in self._in_use:
                raise _refuse(directory, "another monitor writes there")
            self._in_use.add(path)
        return path

    def close(self) -> None:
        """Remove the temporary directory unless something was written there."""
        if self._own_root is not None:
            with contextlib.suppress(OSError):
                self._own_root.rmdir()

    def release(self, path: Path) -> None:
        """Give a directory free for the next monitor."""
        with self._lock:
            self._in_use.discard(path)

    def _find_root(self) -> Path:
        with self._lock:
            if self._root is None:
                self._root = self._own_root = Path(tempfile.mkdtemp(prefix="gym-monitor-"))
            return self._root

    def _resolve(self, directory: str) -> Path:
        if "\0" in directory:
            raise _refuse(directory, "it contains a NUL")
        if ".." in PurePosixPath(directory).parts or ".." in PureWindowsPath(directory).parts:
            raise _refuse(directory, "it climbs")
        try:
            # Links are followed before the comparison, so that none leads out.
            own = self._find_root()
            path = Path(own, directory).resolve()
            allowed = [root.resolve() for root in (own, *self._allowed)]
        except (OSError, RuntimeError, ValueError) as error:
            raise _refuse(directory, str(error)) from error
        if not any(root in path.parents for root in allowed):
            raise _refuse(directory, "it is outside the directory that this server may write")
        return path


def claim(
    path: Path, directory: str, force: bool, resume: bool, on_release: Callable[[Path], None]
) -> MonitorDirectory:
    """Make a reserved directory ready for its monitor; see ``MonitorRoot.claim()``."""
    claimed = MonitorDirectory(path, on_release)
    try:
        path.mkdir(parents=True, exist_ok=True)
        if path.resolve() != path:
            raise _refuse(directory, "it leads elsewhere")
        claimed.prepare(force, resume)
    except OSError as error:
        claimed.release()
        raise _refuse(directory, error.strerror or str(error)) from error
    except BaseException:
        claimed.release()
        raise
    return claimed


class MonitorDirectory:
    """A directory that one monitor writes, and the list of files that monitors wrote there.

    Attributes:
        path: where it is.
        next_episode: the number of the episode that begins next.
    """

    def __init__(self, path: Path, on_release: Callable[[Path], None]) -> None:
        """Name a directory; ``MonitorRoot.claim()`` prepares it."""
        self.path = path
        self.next_episode = 0
        self._files: set[str] = set()
        self._on_release = on_release
        self._prepared = False

    def prepare(self, force: bool, resume: bool) -> None:
        """Read what earlier monitors left and keep it, delete it or refuse; see ``claim()``."""
        self._read_manifest()
        # Whatever the list says, a monitor writes and deletes files of these names only.
        present = {name for name in os.listdir(self.path) if _is_monitor_file(name)}
        foreign = present - self._files
        if foreign:
            raise _refuse(
                str(self.path),
                f"it holds {min(foreign)}, which no monitor of this server wrote",
                "move that file away, or take another directory",
            )
        linked = [name for name in present if (self.path / name).is_symlink()]
        if linked:
            raise _refuse(str(self.path), f"{linked[0]} is a link")
        if force:
            for name in present:
                (self.path / name).unlink()
            self._files.clear()
            self.next_episode = 0
        elif present and not resume:
            raise _refuse(
                str(self.path),
                "it holds the files of an earlier monitor",
                "take force = true to delete them, or resume = true to go on counting",
            )
        self._prepared = True
        self.add(EPISODES)

    def open_table(self, columns: Iterable[str]) -> TextIO:
        """Open the table of episodes for appending; a new one gets its header."""
        path = self.path / EPISODES
        try:
            table = open(path, "a", encoding="ascii", newline="")  # noqa: SIM115 - kept open
            if table.tell() == 0:
                table.write(",".join(columns) + "\n")
                table.flush()
            return table
        except OSError as error:
            raise _refuse(str(self.path), error.strerror or str(error)) from error

    def add(self, name: str) -> None:
        """Put a file on the list, before it is written."""
        self._files.add(name)
        self._write_manifest()

    def release(self) -> None:
        """Write the list for a later monitor and give the directory free."""
        try:
            if self._prepared:
                self._write_manifest()
        finally:
            self._on_release(self.path)

    def _read_manifest(self) -> None:
        path = self.path / MANIFEST
        try:
            manifest = json.loads(path.read_text(encoding="utf-8"))
            self._files = {str(name) for name in manifest["files"]}
            # A server that was killed could not write the last number.
            self.next_episode = max([int(manifest["next_episode"]), *self._episodes_in_table()])
        except FileNotFoundError:
            return
        except (ValueError, KeyError, TypeError) as error:
            raise _refuse(str(self.path), "what an earlier monitor left is damaged") from error

    def _episodes_in_table(self) -> list[int]:
        try:
            lines = (self.path / EPISODES).read_text(encoding="ascii").splitlines()[1:]
            return [int(line.split(",")[0]) + 1 for line in lines if line]
        except FileNotFoundError:
            return []

    def _write_manifest(self) -> None:
        manifest = {
            "written_by": "gym_server",
            "next_episode": self.next_episode,
            "files": sorted(self._files),
        }
        new = self.path / f"{MANIFEST}.new"
        # Made anew, so that no link of that name is followed.
        new.unlink(missing_ok=True)
        with open(new, "x", encoding="utf-8") as file:
            json.dump(manifest, file, indent=1)
        new.replace(self.path / MANIFEST)


def _is_monitor_file(name: str) -> bool:
    return name == EPISODES or _VIDEO.fullmatch(name) is not None


def _refuse(directory: str, reason: str, hint: str | None = None) -> GymServerError:
    return GymServerError(
        "monitor_directory",
        f"The directory {brief(directory)} cannot be used: {reason}",
        hint or "name a directory relative to the server's --monitor-dir, such as 'cartpole-1'",
    )
