"""A group of sub-environments in this process, called as one in another process is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gym_server.envs.wrappers import draws_when_stepped
from gym_server.processes.memory import measured
from gym_server.rendering.render_thread import RenderThread
from gym_server.vector_envs.group import Group


class LocalGroup:
    """Has the methods of ``GroupProcess`` by which a group is called.

    Attributes:
        grown: by how many bytes drawing it has made this process grow.
    """

    def __init__(self, group: Group, renderer: RenderThread) -> None:
        """Take over a group; it draws on the render thread."""
        self._group = group
        self._renderer = renderer
        self.grown = 0
        self._drawn = any(map(draws_when_stepped, group.envs))
        self._call: Callable[[], Any] = lambda: None

    def begin(self, method: str, *args: object) -> None:
        """Note a call of one of the group's methods."""
        self._call = lambda: getattr(self._group, method)(*args)
        if method == "render":
            self._drawn = True
            self._call = lambda: self._draw(*args)

    def _draw(self, *args: Any) -> object:
        frame, grown = self._renderer.run(measured, lambda: self._group.render(*args))
        self.grown += grown
        return frame

    def finish(self) -> Any:
        """Make the call, and return its result."""
        return self._call()

    def close(self) -> None:
        """Close the group."""
        self._renderer.close(self._group.close, self._drawn)
