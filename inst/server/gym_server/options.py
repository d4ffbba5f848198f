"""What can be said on the command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from gym_server import __version__
from gym_server.guard import split_host
from gym_server.token_file import VARIABLE


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    options = argparse.ArgumentParser(
        prog="gym-http-server",
        description="Gymnasium environments over HTTP.",
        # --token would be taken for --token-file, and an error would show it.
        allow_abbrev=False,
    )
    options.add_argument("--host", default="127.0.0.1", help="address to listen on (%(default)s)")
    options.add_argument(
        "--port",
        type=_number(0, 65535),
        default=5000,
        help="port; 0 takes a free one (%(default)s)",
    )
    options.add_argument(
        "--log-level",
        default="warning",
        choices=("debug", "info", "warning", "error"),
        help="what goes to standard error (%(default)s)",
    )
    options.add_argument(
        "--stop-on-stdin-eof", action="store_true", help="stop when standard input closes"
    )
    options.add_argument(
        "--monitor-dir", type=Path, help="monitors write below it (a fresh temporary directory)"
    )
    options.add_argument(
        "--allow-module",
        action="append",
        default=[],
        metavar="NAME",
        help="a module that an env_id such as NAME:Id-v0 may import; repeatable",
    )
    options.add_argument(
        "--max-body-mb",
        type=_number(1, 1024),
        default=16,
        help="size of the largest request (%(default)s)",
    )
    options.add_argument(
        "--max-num-envs",
        type=_number(1, 1_000_000),
        default=16384,
        help="lanes of the largest vector environment (%(default)s)",
    )
    _add_access(options)
    options.add_argument("--version", action="version", version=__version__)
    return options


def _host_name(text: str) -> str:
    try:
        split_host(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is neither NAME nor NAME:PORT") from None
    return text


class _RefuseToken(argparse.Action):
    """Refuses a token where everybody on the machine can read it, without repeating it."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        parser.error(
            "a token on the command line is seen by everybody on this machine; --token-file FILE "
            f"or the variable {VARIABLE} hold it"
        )


def _add_access(options: argparse.ArgumentParser) -> None:
    options.add_argument("--token", action=_RefuseToken, help=argparse.SUPPRESS)
    options.add_argument(
        "--token-file",
        type=Path,
        metavar="FILE",
        help="holds a token of 16 characters or more, which every request must carry; without "
        f"this option the variable {VARIABLE} may hold it",
    )
    options.add_argument(
        "--no-auth",
        action="store_true",
        help="serve everybody without a token, also on a --host that others can reach",
    )
    options.add_argument(
        "--allow-host",
        action="append",
        default=[],
        type=_host_name,
        metavar="NAME",
        help="a further name (or NAME:PORT) that the server is known by, such as a proxy's; "
        "repeatable",
    )
    options.add_argument(
        "--no-shutdown", action="store_true", help="clients cannot stop the server"
    )
    options.add_argument(
        "--allow-path",
        action="append",
        default=[],
        type=Path,
        metavar="DIR",
        help="a directory in which kwargs may name files, on a server with a token or a --host "
        "that others can reach; repeatable",
    )


def _number(least: int, greatest: int) -> Callable[[str], int]:
    def parse(text: str) -> int:
        if not text.isdecimal() or not least <= int(text) <= greatest:
            raise argparse.ArgumentTypeError(f"{text!r} is not between {least} and {greatest}")
        return int(text)

    return parse
