"""What the server asks of its application."""

from __future__ import annotations

from typing import Protocol

from gym_server.response import Response


class Application(Protocol):
    """Makes the responses; an environment is a request as WSGI has it."""

    def respond(self, environ: dict) -> Response:
        """Answer a request, whatever goes wrong with it."""

    def admit(self, environ: dict) -> Response | None:
        """Return what refuses a request whose large body is still to come; None to read it."""

    def recognizes(self, environ: dict) -> bool:
        """Tell whether a client may stay connected; others get one answer and have less time."""

    def refuse(self, status: int, reason: str) -> Response:
        """Answer what does not become a request: 400 for a reason, 413 or 503."""

    def begin_stop(self) -> None:
        """Let those requests end soon that would otherwise wait for longer than the stop takes."""
