"""A group of sub-environments in this process, called as one in another process is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gym_server.envs.drawing import Drawing
from gym_server.vector_envs.group import Group


class LocalGroup:
    """Has the methods of ``WorkerProcess`` by which a group is called."""

    def __init__(self, group: Group, drawing: Drawing) -> None:
        """Take over a group, and how it is drawn."""
        self._group = group
        self._drawing = drawing
        self._call: Callable[[], Any] = lambda: None

    def begin(self, method: str, *args: object) -> None:
        """Note a call of one of the group's methods."""
        self._call = lambda: getattr(self._group, method)(*args)
        if method == "render":
            self._call = lambda: self._drawing.draw(self._group.render, *args)

    def finish(self) -> Any:
        """Make the call, and return its result."""
        return self._call()

    def close(self) -> None:
        """Close the group."""
        self._drawing.close(self._group.close)
