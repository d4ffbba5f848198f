"""End a server in which a call hangs: nothing else can end a thread that is in an environment.

A call that hangs in Python leaves the other threads their turn, so a thread finds it. C code that
holds Python's lock stops all threads; then faulthandler's thread, which is one of C, ends the
process.
"""

from __future__ import annotations

import faulthandler
import logging
import os
import signal
import threading
import time

from gym_server.processes import start
from gym_server.threads import calls

log = logging.getLogger(__name__)

_LONGEST_BEAT = 1.0
_SHARE_OF_LIMIT = 0.1


def end_when_stuck(seconds: float) -> None:
    """End the process, with the stacks of all threads in the log, when a call hangs for this long.

    Args:
        seconds: how long; 0 for no limit.
    """

    def watch() -> None:
        while True:
            try:
                _beat(seconds)
            except Exception:
                # Such as no memory for faulthandler's thread, which may come back.
                log.exception("A bug in the server")
            time.sleep(min(_LONGEST_BEAT, _SHARE_OF_LIMIT * seconds))

    if seconds:
        threading.Thread(target=watch, name="heartbeat", daemon=True).start()
        if hasattr(signal, "SIGTSTP"):
            signal.signal(signal.SIGTSTP, lambda *_: _pause())


def _pause() -> None:
    # By Ctrl-Z in a terminal. Time goes on for faulthandler while no thread can put off the end.
    faulthandler.cancel_dump_traceback_later()
    os.kill(os.getpid(), signal.SIGSTOP)


def _beat(seconds: float) -> None:
    hanging = calls.overdue(seconds)
    if hanging is None:
        # Each time this puts off the end that it has set before.
        faulthandler.dump_traceback_later(seconds, exit=True)
        return
    log.critical(
        "%s took more than %g seconds, so the server ends; its option --max-call-seconds sets "
        "the limit",
        hanging,
        seconds,
    )
    faulthandler.dump_traceback()
    start.remove_temporary_folder()
    os._exit(1)
