"""A group of sub-environments in this process, with the interface of a worker process."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gym_server.envs.drawing import Drawing
from gym_server.vector_envs.group import Group


class LocalGroup:
    """Has those methods of ``WorkerProcess`` that are used to call a group."""

    def __init__(self, group: Group, drawing: Drawing) -> None:
        """Take over a group, and the object that draws it."""
        self._group = group
        self._drawing = drawing
        self._call: Callable[[], Any] = lambda: None

    def begin(self, method: str, *args: object) -> None:
        """Prepare a call of one of the group's methods."""
        self._call = lambda: getattr(self._group, method)(*args)
        if method == "render":
            self._call = lambda: self._drawing.draw(self._group.render, *args)

    def finish(self) -> Any:
        """Make the call, and return its result."""
        return self._call()

    def close(self) -> None:
        """Close the group."""
        self._drawing.close(self._group.close)
