"""The options of the command line."""

from __future__ import annotations

import argparse
import contextlib
import math
from collections.abc import Callable
from pathlib import Path

from gym_server import __version__
from gym_server.api.access import split_host
from gym_server.cli.token_file import VARIABLE
from gym_server.manager.limits import Limits


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    options = argparse.ArgumentParser(
        prog="gym-http-server",
        description="Gymnasium environments over HTTP.",
        # Otherwise --token would be taken for --token-file, and an error would print the token.
        allow_abbrev=False,
    )
    options.add_argument("--host", default="127.0.0.1", help="address to listen on (%(default)s)")
    options.add_argument(
        "--port",
        type=_number(0, 65535),
        default=5000,
        help="port; 0 picks a free one (%(default)s)",
    )
    options.add_argument(
        "--stop-on-stdin-eof", action="store_true", help="stop when standard input closes"
    )
    options.add_argument(
        "--monitor-dir", type=Path, help="where monitors write (a new temporary directory)"
    )
    options.add_argument(
        "--allow-module",
        action="append",
        default=[],
        metavar="NAME",
        help="a module that an env_id such as NAME:Id-v0 may import; may be repeated",
    )
    _add_limits(options)
    _add_ended(options)
    _add_access(options)
    options.add_argument("--version", action="version", version=__version__)
    return options


def _add_limits(options: argparse.ArgumentParser) -> None:
    limits = options.add_argument_group("limits")

    def add(name: str, kind: Callable[[str], float], text: str, metavar: str | None = None) -> None:
        """Add the option for a field of ``Limits``."""
        option = f"--{name.replace('_', '-')}"
        default = getattr(Limits, name)
        limits.add_argument(option, type=kind, default=default, help=text, metavar=metavar)

    add(
        "max_processes",
        _number(1, 100_000),
        "processes that run sub-environments, of all environments, and besides these as many that "
        "play whole episodes, but no more than cores (%(default)s)",
    )
    limits.add_argument(
        "--max-memory-mb",
        type=_number(1, 2**24),
        help="memory that the server's process may take, and each of its processes, besides what "
        "a new server has; on Linux only (three quarters of the machine's)",
    )
    add(
        "max_call_seconds",
        _duration,
        "how long a call may take before its process ends, which can be the server; 0 for no limit "
        "(%(default)g)",
        "SECONDS",
    )
    add(
        "idle_minutes",
        _duration,
        "how long an environment may be unused and unwatched before it is closed; 0 for no limit "
        "(%(default)g, a day)",
        "MINUTES",
    )


def _duration(text: str) -> float:
    with contextlib.suppress(ValueError):
        if 0 <= float(text) < math.inf:
            return float(text)
    raise argparse.ArgumentTypeError(f"{text!r} is not a number of at least 0")


# Options of earlier versions, and what to do instead.
_ENDED = {
    "--allow-path": "the user of a server with a token may name any file",
    "--isolate": "the server serves one user, and environments play in its own process; for a "
    "class, --users FILE starts a server for each user",
    "--log-level": "the log has everything, and each line its level",
    "--max-body-mb": "a request may have 16 MiB",
    "--max-instances": "a server may have 1,000 environments; --max-memory-mb limits its memory",
    "--max-monitor-mb": "the server's user looks after the disk; a service can have a quota",
    "--max-num-envs": "an environment may have 100,000 sub-environments; --max-memory-mb limits "
    "the server's memory",
    "--max-rollout-processes": "--max-processes limits them too; otherwise there is one a core, "
    "and the variable PYTHON_CPU_COUNT can say how many cores",
    "--max-total-sub-envs": "--max-memory-mb limits the server's memory",
    "--max-watchers": "every watch page is one of the server's user",
    "--max-worker-mb": "--max-memory-mb limits the server",
    "--no-shutdown": "the server serves one user, who may stop it; for a class, --users FILE "
    "starts it anew at the next request",
    "--own-log": "redirect standard error to the file",
    "--own-token": f"the variable {VARIABLE}, or --token-file FILE, has the token",
}


class _RefuseEnded(argparse.Action):
    """Refuses an option that earlier versions had, and says what replaces it."""

    def __call__(
        self, parser: argparse.ArgumentParser, _: object, __: object, option: str | None = None
    ) -> None:
        parser.error(f"{option} is gone: {_ENDED[str(option)]}")


def _add_ended(options: argparse.ArgumentParser) -> None:
    for option in _ENDED:
        options.add_argument(
            option,
            nargs="?",
            action=_RefuseEnded,
            default=argparse.SUPPRESS,
            help=argparse.SUPPRESS,
        )


def _host_name(text: str) -> str:
    try:
        split_host(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is neither NAME nor NAME:PORT") from None
    return text


class _RefuseToken(argparse.Action):
    """Refuses a token that everybody on the machine can read, without repeating it."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        parser.error(
            "everybody on this machine can see a token on the command line; use --token-file FILE "
            f"or the variable {VARIABLE}"
        )


def _add_access(options: argparse.ArgumentParser) -> None:
    options.add_argument("--token", action=_RefuseToken, help=argparse.SUPPRESS)
    options.add_argument(
        "--token-file",
        type=Path,
        metavar="FILE",
        help="contains a token of 16 characters or more that every request must have; without "
        f"this option, the variable {VARIABLE} may contain it",
    )
    options.add_argument(
        "--users",
        type=Path,
        metavar="FILE",
        help="contains a name and a token on each line: each user gets a server of their own, with "
        "all limits for itself, which starts at the first request and ends when it was unused for "
        "--idle-minutes; read again when it changes",
    )
    options.add_argument(
        "--no-auth",
        action="store_true",
        help="serve everybody without a token, even on a --host that others can reach",
    )
    options.add_argument(
        "--allow-host",
        action="append",
        default=[],
        type=_host_name,
        metavar="NAME",
        help="another name (or NAME:PORT) of the server, such as a proxy's; may be repeated",
    )


def _number(least: int, greatest: int) -> Callable[[str], int]:
    def parse(text: str) -> int:
        if not text.isdecimal() or not least <= int(text) <= greatest:
            raise argparse.ArgumentTypeError(f"{text!r} is not between {least} and {greatest}")
        return int(text)

    return parse
