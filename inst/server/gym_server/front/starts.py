"""What each user's server gets of the machine."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gym_server.front.control_groups import ControlGroups
from gym_server.front.folders import Folders
from gym_server.memory import machine_mb
from gym_server.processes.cores import usable_cores
from gym_server.tokens import CannotStartError

log = logging.getLogger(__name__)

# A server needs this much to begin with, in MiB.
_LEAST_MB = 128


@dataclass(frozen=True)
class Start:
    """How a server is started.

    Attributes:
        arguments: its options.
        folder: its working directory.
        uid: the account that it runs under; None for that of the front.
        group: its control group, or None.
    """

    arguments: Sequence[str]
    folder: Path
    uid: int | None = None
    group: Path | None = None


class Starts:
    """Decides how the servers are started."""

    def __init__(
        self,
        folders: Folders,
        users: int,
        arguments: Sequence[str],
        memory_mb: int | None,
        processes: int | None,
    ) -> None:
        """Find out what the system offers, and say what it does not.

        Args:
            folders: the working directories.
            users: how many users there are.
            arguments: options of all servers.
            memory_mb: the memory of a user's server with all its processes, in MiB; None for an
                equal part of three quarters of the machine's.
            processes: the processes of a user's environments; None for one per core. Besides these,
                as many play whole episodes, but no more than one per core.

        Raises:
            CannotStartError: too little memory is left for each.
        """
        self._folders = folders
        self._arguments = arguments
        self._memory_mb = memory_mb
        self._environment_processes = own = processes or usable_cores()
        # How many processes a user may have where only each of them is limited.
        self._processes = 1 + own + min(own, usable_cores())
        self._groups: ControlGroups | None = None
        reason = None
        try:
            self._groups = ControlGroups()
        except OSError as error:
            reason = error.strerror
        share = self._share_mb(users)
        if reason is not None:
            log.warning(
                "There are no cgroups to divide the machine (%s): each user may have %d processes "
                "of %d MiB, and slows the others by what they share. A systemd unit with "
                "Delegate=yes has cgroups",
                reason,
                self._processes,
                share // self._processes,
            )

    def close(self) -> None:
        """Remove what was made for the servers and holds nothing."""
        self._folders.close()
        if self._groups is not None:
            self._groups.close()

    def _share_mb(self, users: int) -> int:
        """Return the memory of a user, in MiB: an equal part of three quarters of the machine's."""
        share = self._memory_mb or machine_mb() * 3 // 4 // users
        parts = 1 if self._groups is not None else self._processes
        if share // parts < _LEAST_MB:
            raise CannotStartError(
                f"{share} MiB for each user are too little for {parts} processes of "
                f"{_LEAST_MB} MiB (one, where there are cgroups); use a larger --max-memory-mb, or "
                "a smaller --max-processes"
            )
        return share

    def of(self, name: str, users: int) -> Start:
        """Return how to start a user's server.

        Args:
            name: the user's name.
            users: how many users there are.

        Raises:
            CannotStartError: too little memory is left for each.
            OSError: the folder or the control group cannot be made.
        """
        share = self._share_mb(users)
        folder, uid = self._folders.of(name)
        group = None
        if self._groups is not None:
            group = self._groups.make(name, share)
            limits = ["--max-memory-mb", str(share)]
        else:
            limits = [
                *("--max-memory-mb", str(share // self._processes)),
                *("--max-processes", str(self._environment_processes)),
            ]
        return Start((*self._arguments, *limits), folder, uid, group)
