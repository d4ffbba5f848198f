"""Write observations for clients."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

from gymnasium.spaces import Space

from gym_server import spaces
from gym_server.protocol.answers import AnswerForm


class ObservationWriter:
    """Writes the observations of one space, or batches of them, as JSON values or tensors."""

    def __init__(self, space: Space, is_batch: bool) -> None:
        """Prepare to write.

        Args:
            space: the space of one observation.
            is_batch: whether batches are written.
        """
        self._space = space
        self._is_batch = is_batch
        # Saves the dispatch on the space for each observation.
        encode = spaces.encode_batch if is_batch else spaces.encode
        self._write_json: Callable[[Space, Any], Any] = encode.dispatch(type(space))

    @cached_property
    def _write_tensors(self) -> dict[str, Callable[[Any, bool], spaces.Parts]]:
        space = self._space
        names = ("observation", "final_obs") if spaces.travels_as_tensors(space) else ()
        return {name: spaces.tensor_writer(space, name, self._is_batch) for name in names}

    def __call__(self, observation: Any, form: AnswerForm, name: str = "observation") -> object:
        """Return an observation, or a batch, as JSON values or ``Parts``."""
        if form.tensors and self._write_tensors:
            return self._write_tensors[name](observation, form.by_column)
        return self._write_json(self._space, observation)
