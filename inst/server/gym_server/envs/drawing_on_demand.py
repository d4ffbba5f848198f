"""Prepare environments for drawing only on demand, where being able to draw takes time.

While LunarLander has a render mode, it adds sparks to its world in each step. That triples the time
of a step and changes nothing else.
"""

from __future__ import annotations

import gymnasium

from gym_server.envs.wrappers import draws_when_stepped

_DECORATING = ("gymnasium.envs.box2d.lunar_lander",)


def save_drawing(env: gymnasium.Env) -> str | None:
    """Remove the render mode of an environment that works for it in each step.

    Returns:
        The render mode, for ``allow_drawing()``; None if the environment was not changed.
    """
    base = env.unwrapped
    if type(base).__module__ not in _DECORATING or draws_when_stepped(env):
        return None
    render_mode, base.render_mode = base.render_mode, None
    return render_mode


def allow_drawing(env: gymnasium.Env, render_mode: str | None) -> None:
    """Restore the render mode that ``save_drawing()`` removed."""
    if render_mode is not None:
        env.unwrapped.render_mode = render_mode
