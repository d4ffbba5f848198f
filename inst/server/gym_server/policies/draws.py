"""Random numbers of an episode, from a generator of its own.

``SeedSequence([seed, 1])`` and not ``seed``: the environment's own generator is made of that, and
a policy must not repeat its numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import PCG64, Generator, SeedSequence

# To draw one number takes as long as to draw thirty; many episodes end before they need more.
_FIRST = 16
_MOST = 512


def _seed_sequence(seed: int) -> SeedSequence:
    # Of a list NumPy makes such an array, which takes twice as long.
    return SeedSequence(np.array([seed, 1], np.uint32) if seed < 2**32 else [seed, 1])


class EpisodeGenerator:
    """The generator of an episode, made when it is first asked for: to make one takes 15 us."""

    def __init__(self) -> None:
        self._seed = 0
        self._generator: Generator | None = None

    def begin(self, seed: int) -> None:
        """Forget the generator; the next one is made from this seed."""
        self._seed = seed
        self._generator = None

    def get(self) -> Generator:
        """Return the generator of the episode."""
        if self._generator is None:
            self._generator = Generator(PCG64(_seed_sequence(self._seed)))
        return self._generator

    def uniforms(self, *shape: int) -> np.ndarray:
        """Draw numbers from 0 to 1."""
        return self.get().random(shape)


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
        self._source = EpisodeGenerator()
        self._size = 0
        # Those drawn ahead, the next one last.
        self._rest: list[Any] = []
        self.take = self._taker()

    def begin(self, seed: int) -> None:
        """Forget what was drawn ahead, and draw from this seed."""
        self._source.begin(seed)
        self._rest.clear()
        self._size = min(_FIRST, self._most)

    def _taker(self) -> Callable[..., Any]:
        pop = self._rest.pop
        fill = self._fill

        def take(_observation: object = None) -> Any:
            try:
                return pop()
            except IndexError:
                fill()
                return pop()

        return take

    def _fill(self) -> None:
        self._rest.extend(reversed(self._block(self._source.get(), self._size)))
        self._size = min(2 * self._size, self._most)


def uniforms() -> Draws:
    """Return draws of numbers from 0 to 1, uniformly."""
    return Draws(lambda generator, n: generator.random(n).tolist())
