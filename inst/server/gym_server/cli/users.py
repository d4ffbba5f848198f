"""The option --users: a front, which starts a server for each user, instead of one server."""

from __future__ import annotations

import argparse
import os
import socket

from gym_server.api.access import is_loopback
from gym_server.cli.token_file import VARIABLE
from gym_server.front.folders import Folders
from gym_server.front.front import Front
from gym_server.front.starts import Starts
from gym_server.front.users_file import UsersFile
from gym_server.manager.limits import Limits
from gym_server.tokens import CannotStartError


def make_front(options: argparse.Namespace, listener: socket.socket) -> Front:
    """Return the front that the options of the command line describe.

    Raises:
        CannotStartError: it cannot start.
    """
    if os.name != "posix":
        raise CannotStartError("--users needs Linux or macOS; on Windows, start a server a user")
    if options.no_auth or options.token_file is not None:
        raise CannotStartError(
            "--users has the token of each user, so it excludes --no-auth and --token-file"
        )
    # A token in the variable is not meant for this server.
    os.environ.pop(VARIABLE, None)
    try:
        users = UsersFile(options.users)
        folders = Folders(options.monitor_dir)
        if options.allow_module and not folders.separate:
            raise CannotStartError(
                "--allow-module would let users act on each other's servers, which run under one "
                "account here; start it as root, with a Python that all accounts can run, or leave "
                "it out"
            )
        starts = Starts(
            folders,
            len(users.users),
            _arguments(options),
            options.max_memory_mb,
            None if options.max_processes == Limits.max_processes else options.max_processes,
        )
    except OSError as error:
        raise CannotStartError(
            f"the directory {error.filename} cannot be used: {error.strerror}"
        ) from None
    return Front(listener, users, starts)


def _arguments(options: argparse.Namespace) -> list[str]:
    """Return the options of all users' servers."""
    hosts = list(options.allow_host)
    if not is_loopback(options.host):
        hosts.append(socket.getfqdn())
    return [
        *(f"--allow-host={name}" for name in hosts),
        *(f"--allow-module={name}" for name in options.allow_module),
        f"--max-call-seconds={options.max_call_seconds}",
        f"--idle-minutes={options.idle_minutes}",
        "--monitor-dir=.",
    ]
