"""What the server needs from its application."""

from __future__ import annotations

from typing import Protocol

from gym_server.response import Admission, Response


class Application(Protocol):
    """Makes the responses. A request's head is given as a WSGI environ."""

    def admit(self, environ: dict) -> Admission | Response:
        """Say how to answer a request before its body is read, or refuse it."""

    def refuse(self, status: int, reason: str) -> Response:
        """Answer bytes that are not a request: 400 with a reason, or 413."""

    def begin_stop(self) -> None:
        """End requests soon that would otherwise wait for longer than the stop takes."""
