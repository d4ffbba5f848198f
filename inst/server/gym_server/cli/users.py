"""The option --users: a front, which starts a server for each user, instead of one server."""

from __future__ import annotations

import argparse
import os
import socket
from collections.abc import Iterator
from pathlib import Path

from gym_server.api.access import is_loopback
from gym_server.cli.options import parser
from gym_server.cli.token_file import VARIABLE
from gym_server.front.folders import Folders
from gym_server.front.front import Front
from gym_server.front.starts import ShareError, Starts, Wishes
from gym_server.front.users_file import UsersFile, UsersFileError

# The options that are about the front, or that it decides for its servers.
_OF_THE_FRONT = frozenset(
    {
        *("users", "host", "port", "allow_host", "token_file", "no_auth"),
        *("stop_on_stdin_eof", "monitor_dir", "max_memory_mb", "max_processes"),
    }
)


class BadUsersError(Exception):
    """The front cannot start; the message says how to change that."""


def make_front(options: argparse.Namespace, listener: socket.socket) -> Front:
    """Return the front that the options of the command line describe.

    Raises:
        BadUsersError: it cannot start.
    """
    if os.name != "posix":
        raise BadUsersError("--users needs Linux or macOS; on Windows, start a server a user")
    if options.no_auth or options.token_file is not None:
        raise BadUsersError(
            "--users has the token of each user, so it excludes --no-auth and --token-file"
        )
    # A token in the variable is not meant for this server.
    os.environ.pop(VARIABLE, None)
    try:
        users = UsersFile(options.users)
        folders = Folders(options.monitor_dir)
        if options.allow_module and not folders.separate:
            raise BadUsersError(
                "--allow-module would let users act on each other's servers, which run under one "
                "account here; start it as root, with a Python that all accounts can run, or leave "
                "it out"
            )
        starts = Starts(folders, _wishes(options), len(users.users))
    except (UsersFileError, ShareError) as error:
        raise BadUsersError(str(error)) from None
    except OSError as error:
        raise BadUsersError(
            f"the directory {error.filename} cannot be used: {error.strerror}"
        ) from None
    return Front(listener, users, starts, options.idle_minutes)


def _wishes(options: argparse.Namespace) -> Wishes:
    defaults = vars(parser().parse_args([]))
    given = {name: value for name, value in vars(options).items() if value != defaults[name]}
    hosts = list(options.allow_host)
    if not is_loopback(options.host):
        hosts.append(socket.getfqdn())
    arguments = [f"--allow-host={name}" for name in hosts] + ["--monitor-dir=."]
    for name in given.keys() - _OF_THE_FRONT:
        arguments += _as_arguments(f"--{name.replace('_', '-')}", given[name])
    return Wishes(
        arguments,
        given.get("max_memory_mb"),
        given.get("max_processes"),
        options.max_rollout_processes,
    )


def _as_arguments(option: str, value: object) -> Iterator[str]:
    if value is True:
        yield option
        return
    for one in value if isinstance(value, list) else [value]:
        # A server has another working directory.
        yield f"{option}={one.resolve() if isinstance(one, Path) else one}"
