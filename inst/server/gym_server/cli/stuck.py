"""End a server in which no Python code runs any more.

A call that hangs in Python leaves the other threads their turn, and the watchdog answers for it. C
code that holds Python's lock stops all threads. Only a thread of C, such as faulthandler's, can
end the process then.
"""

from __future__ import annotations

import faulthandler
import threading
import time

_LONGEST_BEAT = 1.0
_SHARE_OF_LIMIT = 0.1


def end_when_stuck(seconds: float) -> None:
    """End the process, with the stacks of all threads in the log, when it is stuck for this long.

    Args:
        seconds: how long; 0 for no limit.
    """

    def beat() -> None:
        while True:
            # Each call puts off the end that the one before has set.
            faulthandler.dump_traceback_later(seconds, exit=True)
            time.sleep(min(_LONGEST_BEAT, _SHARE_OF_LIMIT * seconds))

    if seconds:
        threading.Thread(target=beat, name="heartbeat", daemon=True).start()
