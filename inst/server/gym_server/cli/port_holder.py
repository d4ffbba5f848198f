"""Find out which program has a server's port."""

from __future__ import annotations

import contextlib
import http.client
import json

_ANSWER_SECONDS = 2.0
_LARGEST_ANSWER = 2**16


def port_holder(host: str, port: int) -> str | None:
    """Ask the program that listens on a port what it is, without sending a token.

    Returns:
        Words that end in "has it"; None if no program listens.
    """
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)
    answer = None
    with contextlib.closing(http.client.HTTPConnection(host, port, timeout=_ANSWER_SECONDS)) as it:
        try:
            it.connect()
        except OSError:
            return None
        with contextlib.suppress(OSError, http.client.HTTPException, ValueError):
            it.request("GET", "/v1/health/")
            answer = json.loads(it.getresponse().read(_LARGEST_ANSWER))
    match answer:
        case {"versions": {"gym_server": str(version)}, "pid": int(pid)}:
            return f"a Gym server {version[:20]} (process {pid}) has it"
        case {"code": "unauthorized"}:
            return "a Gym server that asks for a token has it"
        case _:
            return "another program has it"
