"""Random numbers of an episode, from its own generator.

Its seed is ``SeedSequence([seed, 1])`` and not ``seed``, which seeds the environment's generator: a
policy must not repeat the environment's numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import Any

import numpy as np
from numpy.random import PCG64, Generator, SeedSequence

# Drawing one number takes as long as drawing thirty, but many episodes end before they need more.
_FIRST = 16
_MOST = 512


class Draws:
    """Values that are drawn one after another, some of them in advance.

    Attributes:
        take: returns the next value. It ignores an optional argument, so it can be used as the
            function that acts.
    """

    take: Callable[..., Any]

    def __init__(self, block: Callable[[Generator, int], list[Any]], most: int = _MOST) -> None:
        """Prepare to draw.

        Args:
            block: returns a number of values, the same as from as many calls for one.
            most: the most values to draw in advance.
        """
        self._block = block
        self._most = most
        self._seed = 0
        # Created when it is first needed, which takes 15 us.
        self._generator: Generator | None = None
        self._size = 0
        # The values drawn in advance, in reverse order.
        self._rest: list[Any] = []
        self.take = self._taker()

    def begin(self, seed: int) -> None:
        """Discard the values drawn in advance, and draw from this seed."""
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
    # NumPy converts a list to such an array, which takes twice as long.
    return SeedSequence(np.array([seed, 1], np.uint32) if seed < 2**32 else [seed, 1])


def uniforms(*shape: int) -> Draws:
    """Return draws of numbers between 0 and 1, or of arrays of them."""
    return Draws(lambda generator, n: list(generator.random((n, *shape))), _most_of(shape))


def normals(*shape: int) -> Draws:
    """Return draws of arrays of standard normal numbers."""
    return Draws(lambda generator, n: list(generator.standard_normal((n, *shape))), _most_of(shape))


def _most_of(shape: tuple[int, ...]) -> int:
    return max(1, _MOST * 8 // prod(shape))
