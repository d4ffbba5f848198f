"""How to draw, and finally close, an environment of this process."""

from __future__ import annotations

from collections.abc import Callable

from gym_server.rendering.render_thread import RenderThread


class Drawing:
    """Draws an environment on the render thread, and closes it there if it was drawn.

    Attributes:
        drawn: whether it may have been drawn.
    """

    def __init__(self, renderer: RenderThread, drawn: bool = False) -> None:
        """Start with an environment that draws in each step (``drawn``), or was not drawn yet."""
        self._renderer = renderer
        self.drawn = drawn

    def draw(self, render: Callable, *args: object) -> object:
        """Call a function that draws, and return the frame."""
        self.drawn = True
        return self._renderer.run(render, *args)

    def close(self, close: Callable[[], object]) -> None:
        """Call the function that closes the environment."""
        self._renderer.close(close, self.drawn)
