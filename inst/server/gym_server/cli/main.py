"""The command line."""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path

from gym_server import logs, memory
from gym_server.api.access import Access, is_loopback
from gym_server.api.app import Config, GymApp, create_app
from gym_server.api.watch_keys import PREFIX_VARIABLE
from gym_server.cli.open_files import allow_many_open_files
from gym_server.cli.options import parser
from gym_server.cli.stuck import end_when_stuck
from gym_server.cli.token_file import VARIABLE, find_token
from gym_server.cli.users import make_front
from gym_server.front.handed_over import VARIABLE as FRONT_VARIABLE
from gym_server.front.handed_over import HandedOver
from gym_server.http_server.server import Server, bind
from gym_server.manager.limits import Limits
from gym_server.processes import start
from gym_server.tokens import CannotStartError

log = logging.getLogger("gym_server")

# The environment variable by which the front (--users) says that all servers run under one account.
SHARED_VARIABLE = "GYM_SERVER_SHARED_ACCOUNT"

# How long requests in progress may take after a stop. A step may never return.
_GRACE_SECONDS = 10.0

# How long closing the environments may take if requests have not ended by then.
_LAST_SECONDS = 2.0


def main(argv: Sequence[str] | None = None) -> int:
    """Serve until asked to stop.

    Args:
        argv: the arguments; None for those of the process.

    Returns:
        The exit status: 0 after a stop, 1 if the server cannot start.
    """
    options = parser().parse_args(argv)
    logs.set_up()
    if options.users is not None:
        return _serve_users(options)
    try:
        token = _find_token(options)
    except CannotStartError as fault:
        return _fail(str(fault))
    except OSError as error:
        return _fail(f"the file {options.token_file} cannot be read: {error.strerror or error}")
    is_open = token is None and not is_loopback(options.host)
    if is_open and not options.no_auth:
        return _fail(
            f"--host {options.host} lets anybody on the network run environments on this machine "
            f"and write files; use --token-file FILE or the variable {VARIABLE}, or --no-auth to "
            "allow this"
        )
    allow_many_open_files()
    memory.limit(options.max_memory_mb)

    def stop() -> None:
        server.stop()

    try:
        monitor_dir = _prepare_monitor_dir(options.monitor_dir)
        front = os.environ.pop(FRONT_VARIABLE, None)
        if front is None:
            listener = bind(options.host, options.port)
        else:
            listener = HandedOver(int(front), stop)
    except OSError as error:
        return _fail(_why_not(error, options))
    app = create_app(
        Config(
            monitor_dir=monitor_dir,
            allowed_modules=options.allow_module,
            limits=Limits(
                **{
                    one.name: getattr(options, one.name)
                    for one in fields(Limits)
                    if hasattr(options, one.name)
                }
            ),
            stop=stop,
            access=Access(token, options.host, options.allow_host),
            is_private=not is_open and os.environ.pop(SHARED_VARIABLE, None) is None,
            watch_prefix=os.environ.pop(PREFIX_VARIABLE, ""),
            ends_unused=front is not None,
        )
    )
    server = Server(app, listener, Config.max_body_bytes)
    _begin(options, server.port, stop)
    _serve(app, server)
    return 0


def _serve_users(options: argparse.Namespace) -> int:
    """Serve each user by a server of their own."""
    allow_many_open_files()
    try:
        listener = bind(options.host, options.port)
    except OSError as error:
        return _fail(_why_not(error, options))
    with listener:
        try:
            front = make_front(options, listener)
        except CannotStartError as fault:
            return _fail(str(fault))
        _begin(options, front.port, front.stop)
        front.run()
    return 0


def _begin(options: argparse.Namespace, port: int, stop: Callable[[], None]) -> None:
    """Do what remains before serving: signals, the log, and the line with the address."""
    _stop_on_signals(stop)
    if options.stop_on_stdin_eof:
        threading.Thread(target=_wait_for_eof, args=(stop,), daemon=True).start()
    end_when_stuck(options.max_call_seconds)
    # Log where C code crashed.
    faulthandler.enable()
    memory.prepare()
    print(f"Server starting at: http://{_in_url(options.host)}:{port}", flush=True)
    # Redirect standard output to standard error: output of environments must not fill a pipe that
    # nobody reads.
    os.dup2(2, 1)


def _find_token(options: argparse.Namespace) -> str | None:
    if options.no_auth and options.token_file is not None:
        raise CannotStartError("--no-auth and --token-file exclude each other")
    token = find_token(options.token_file, os.environ)
    return None if options.no_auth else token


def _in_url(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def _prepare_monitor_dir(directory: Path | None) -> Path | None:
    if directory is None:
        return None
    directory.mkdir(parents=True, exist_ok=True)
    return directory.resolve()


def _why_not(error: OSError, options: argparse.Namespace) -> str:
    if error.filename is not None:
        return f"the directory {error.filename} cannot be used: {error.strerror}"
    return (
        f"port {options.port} on {options.host} cannot be used: {error.strerror or error}; "
        "--port 0 picks a free port"
    )


def _fail(reason: str) -> int:
    print(f"gym_server: {reason}", file=sys.stderr, flush=True)
    return 1


def _stop_on_signals(stop: Callable[[], None]) -> None:
    for name in ("SIGINT", "SIGTERM", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), lambda *_: stop())


def _wait_for_eof(stop: Callable[[], None]) -> None:
    # Do not use sys.stdin: this thread would hold its lock when the interpreter ends.
    with contextlib.suppress(OSError):
        while os.read(0, 4096):
            pass
    stop()


def _serve(app: GymApp, server: Server) -> None:
    answered = server.run(_GRACE_SECONDS)
    closer = threading.Thread(target=app.close, daemon=True)
    closer.start()
    closer.join(_GRACE_SECONDS if answered else _LAST_SECONDS)
    if closer.is_alive() or not answered:
        log.warning("An environment did not finish within %g seconds", _GRACE_SECONDS)
        logging.shutdown()
        start.remove_temporary_folder()
        # An ordinary exit would wait for the thread in the environment.
        os._exit(0)
