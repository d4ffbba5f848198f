"""How Python runs a server in another working directory."""

from __future__ import annotations

import os
import sys
from pathlib import Path

# Like `-m gym_server`, but without the working directory in Python's search path: users may write
# there.
_RUN = (
    "import sys; sys.path[:] = [place for place in sys.path if place]; "
    "import runpy; runpy.run_module('gym_server', run_name='__main__', alter_sys=True)"
)


def command(*options: str) -> list[str]:
    """Return the command line of a server with these options."""
    return [sys.executable, "-c", _RUN, *options]


def environment() -> dict[str, str]:
    """Return the environment variables by which Python finds this package."""
    places = [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, places))}
