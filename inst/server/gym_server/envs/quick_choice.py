"""Let environments choose from short lists as fast as they draw a number.

For each card Blackjack calls ``np_random.choice()`` of a list, which NumPy first makes an array of.
That takes five times as long as to draw the card, and half of an episode.
"""

from __future__ import annotations

from typing import Any

import gymnasium
from numpy.random import PCG64, Generator

_CHOOSING = ("gymnasium.envs.toy_text.blackjack",)


class QuickChoice(Generator):
    """A generator whose ``choice()`` of a list draws what NumPy's does, and leaves it a list."""

    def choice(self, a: Any, *args: Any, **kwargs: Any) -> Any:
        """Return one of ``a``, or what NumPy returns for more arguments."""
        if type(a) is list and not args and not kwargs:
            return a[self.integers(0, len(a))]
        return super().choice(a, *args, **kwargs)


def choose_quickly(env: gymnasium.Env) -> None:
    """Give an environment such a generator whenever it is reset with a seed."""
    base = env.unwrapped
    if type(base).__module__ not in _CHOOSING:
        return
    reset = base.reset

    def reset_with_it(*, seed: int | None = None, options: dict | None = None) -> tuple[Any, dict]:
        if seed is not None:
            base.np_random = QuickChoice(PCG64(seed))
        return reset(options=options)

    base.reset = reset_with_it  # type: ignore[method-assign]
