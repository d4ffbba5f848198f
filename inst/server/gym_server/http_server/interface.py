"""What the server needs from its application."""

from __future__ import annotations

from typing import Protocol

from gym_server.response import Response


class Application(Protocol):
    """Makes the responses. A request is given as a WSGI environ."""

    def respond(self, environ: dict) -> Response:
        """Answer a request; never raise."""

    def admit(self, environ: dict) -> Response | None:
        """Return a response that refuses a request before its large body is read, or None."""

    def recognizes(self, environ: dict) -> bool:
        """Return whether a client may stay connected; others get one response and less time."""

    def refuse(self, status: int, reason: str) -> Response:
        """Answer bytes that are not a request: 400 with a reason, 413 or 503."""

    def begin_stop(self) -> None:
        """End requests soon that would otherwise wait for longer than the stop takes."""
