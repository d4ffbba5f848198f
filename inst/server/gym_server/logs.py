"""How the server and its processes log: to standard error, and little of each error.

What an environment raises may repeat all that a client has sent, as often as the client likes.
"""

from __future__ import annotations

import logging
import time
import traceback
from types import CodeType, TracebackType

from gym_server.json_values import LONGEST_MESSAGE, shortened

_LONGEST_TRACEBACK = 20_000

# For how long a place's next traceback is left out.
_QUIET_SECONDS = 60.0

_Place = tuple[CodeType, int] | None


def set_up(level: str | int, about_process: str = "") -> None:
    """Log to standard error.

    Args:
        level: what is logged.
        about_process: what each line says of its process, as a format of ``logging``.
    """
    handler = logging.StreamHandler()
    handler.setFormatter(
        Formatter(f"%(asctime)s %(levelname)s %(name)s{about_process}: %(message)s")
    )
    logging.basicConfig(level=level, handlers=[handler])
    logging.captureWarnings(True)


class Formatter(logging.Formatter):
    """Cuts long messages, and leaves out tracebacks that would say the same again."""

    def __init__(self, form: str) -> None:
        """Take the format of a line."""
        super().__init__(form)
        # When each place's last traceback was logged.
        self._logged: dict[_Place, float] = {}

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802
        """Return a line; see ``logging``."""
        record.message = shortened(record.message, LONGEST_MESSAGE)
        return super().formatMessage(record)

    def formatException(self, ei: tuple) -> str:  # noqa: N802
        """Return a traceback, if none of the same place was logged a short time ago."""
        error: BaseException = ei[1]
        place = _place((error.__cause__ or error).__traceback__)
        now = time.monotonic()
        self._logged = {p: at for p, at in self._logged.items() if at > now - _QUIET_SECONDS}
        if place in self._logged:
            return "(The traceback of this place was logged less than a minute ago)"
        self._logged[place] = now
        # Its parts are a line of code each, and the message of each error.
        parts = traceback.TracebackException(*ei).format()
        text = "".join(f"{shortened(part.rstrip(), LONGEST_MESSAGE)}\n" for part in parts)
        return shortened(text.rstrip(), _LONGEST_TRACEBACK)


def _place(trace: TracebackType | None) -> _Place:
    """Return where an error was raised."""
    if trace is None:
        return None
    *_, (frame, line) = traceback.walk_tb(trace)
    return frame.f_code, line
