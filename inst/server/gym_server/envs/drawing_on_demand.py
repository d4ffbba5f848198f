"""Let environments draw only when they are asked to, where the possibility alone takes time.

LunarLander adds sparks to its world in each step for as long as it has a render mode, which takes
three times as long as the step without them and changes nothing else.
"""

from __future__ import annotations

import gymnasium

from gym_server.envs.wrappers import draws_when_stepped

_DECORATING = ("gymnasium.envs.box2d.lunar_lander",)


def save_drawing(env: gymnasium.Env) -> str | None:
    """Take its render mode from an environment that works for it in each step.

    Returns:
        The render mode, for ``allow_drawing()``; None for an environment that is left as it is.
    """
    base = env.unwrapped
    if type(base).__module__ not in _DECORATING or draws_when_stepped(env):
        return None
    render_mode, base.render_mode = base.render_mode, None
    return render_mode


def allow_drawing(env: gymnasium.Env, render_mode: str | None) -> None:
    """Give it back the render mode that ``save_drawing()`` has taken."""
    if render_mode is not None:
        env.unwrapped.render_mode = render_mode
