"""Random numbers of an episode, from a generator of its own.

``SeedSequence([seed, 1])`` and not ``seed``: the environment's own generator is made of that, and
a policy must not repeat its numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import Any

import numpy as np
from numpy.random import PCG64, Generator, SeedSequence

# To draw one number takes as long as to draw thirty; many episodes end before they need more.
_FIRST = 16
_MOST = 512


class Draws:
    """Values that are drawn one after the other, some of them ahead.

    Attributes:
        take: returns the next value. It may be given an argument, which it ignores: so it can
            itself be the function that acts.
    """

    take: Callable[..., Any]

    def __init__(self, block: Callable[[Generator, int], list[Any]], most: int = _MOST) -> None:
        """Prepare to draw.

        Args:
            block: returns so many values, the same as from as many calls for one.
            most: how many are drawn ahead at most.
        """
        self._block = block
        self._most = most
        self._seed = 0
        # Made when it is first needed: to make one takes 15 us.
        self._generator: Generator | None = None
        self._size = 0
        # Those drawn ahead, the next one last.
        self._rest: list[Any] = []
        self.take = self._taker()

    def begin(self, seed: int) -> None:
        """Forget what was drawn ahead, and draw from this seed."""
        self._seed = seed
        self._generator = None
        self._rest.clear()
        self._size = min(_FIRST, self._most)

    def _taker(self) -> Callable[..., Any]:
        pop, fill = self._rest.pop, self._fill

        def take(_observation: object = None) -> Any:
            try:
                return pop()
            except IndexError:
                fill()
                return pop()

        return take

    def _fill(self) -> None:
        if self._generator is None:
            self._generator = Generator(PCG64(_seed_sequence(self._seed)))
        self._rest.extend(reversed(self._block(self._generator, self._size)))
        self._size = min(2 * self._size, self._most)


def _seed_sequence(seed: int) -> SeedSequence:
    # Of a list NumPy makes such an array, which takes twice as long.
    return SeedSequence(np.array([seed, 1], np.uint32) if seed < 2**32 else [seed, 1])


def uniforms(*shape: int) -> Draws:
    """Return draws of numbers from 0 to 1, or of arrays of them."""
    if not shape:
        return Draws(lambda generator, n: generator.random(n).tolist())
    return Draws(lambda generator, n: list(generator.random((n, *shape))), _most_of(shape))


def normals(*shape: int) -> Draws:
    """Return draws of arrays of standard normal numbers."""
    return Draws(lambda generator, n: list(generator.standard_normal((n, *shape))), _most_of(shape))


def _most_of(shape: tuple[int, ...]) -> int:
    return max(1, _MOST * 8 // prod(shape))
