"""The messages of a stream: their heads, and the places of arrays whose size never changes.

The arrays are those of a safetensors file for the same request, without the file's header.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from gymnasium.spaces import Dict, Discrete, Space, Tuple

from gym_server import spaces
from gym_server.errors import GymServerError
from gym_server.instances.instance import Instance
from gym_server.protocol.answers import dumps
from gym_server.protocol.safetensors import DTYPES, Parts, Tensor, check_booleans, places

# Of a client's message: what it asks for, the form of the rest, flags, and the request's number.
REQUEST_HEAD = struct.Struct("<BBHxxxxd")
# Of an answer: the form of the rest, the status in HTTP's words, the size of the JSON at the end,
# and the request's number. With the head of a frame of usual size it has 24 bytes, so a reader can
# take a whole message as float64.
ANSWER_HEAD = struct.Struct("<BxHIxxxxd")

# No answer is smaller, so that the heads of all usual frames have 4 bytes.
_FEWEST_BYTES = 112

# How many layouts of a kind a stream remembers.
_MOST_LAYOUTS = 8

STEP, RESET = 0, 1
ARRAYS, JSON_BODY, TENSOR_BODY = 0, 1, 2
NO_INFO, NO_FINALS, REAL_TIME, MASKED = 1, 2, 4, 8


def malformed_message(reason: str) -> GymServerError:
    """Report a message that is not as the layout says."""
    return GymServerError(
        "malformed_message",
        f"The stream's message cannot be read: {reason}",
        "see PROTOCOL.md, and the layout that the server sent first",
    )


class ArrayLayout:
    """Arrays of fixed dtypes and shapes, one after another.

    Attributes:
        table: dtype, shape and place of each by name, as in the header of a safetensors file.
        size: the bytes of all.
    """

    def __init__(self, shapes: spaces.Shapes, as_float64: bool = False) -> None:
        """Place the arrays.

        Args:
            shapes: their dtypes and shapes.
            as_float64: whether their numbers travel as float64.
        """
        self._shapes = shapes
        self.table = places(
            (name, "F64" if as_float64 else dtype, shape) for name, (dtype, shape) in shapes.items()
        )
        self.size = max((entry["data_offsets"][1] for entry in self.table.values()), default=0)
        self.padded_size = max(_FEWEST_BYTES, self.size + -self.size % 8)
        entries = self.table.values()
        self._places = [
            (name, entry["dtype"], entry["shape"], *entry["data_offsets"])
            for name, entry in self.table.items()
        ]
        # One assignment to a field converts, copies and places an array.
        self._record = np.dtype(
            {
                "names": list(self.table),
                "formats": [(DTYPES[entry["dtype"]], _flat(entry["shape"])) for entry in entries],
                "offsets": [entry["data_offsets"][0] for entry in entries],
                "itemsize": self.padded_size,
            }
        )

    def read(self, data: bytes) -> Parts:
        """Return the arrays of a message.

        Raises:
            GymServerError: ``malformed_message``.
        """
        if len(data) != self.size:
            raise malformed_message(f"its arrays have {len(data)} bytes, not {self.size}")
        view = memoryview(data)
        tensors = {
            name: Tensor(dtype, shape, view[begin:end])
            for name, dtype, shape, begin, end in self._places
        }
        try:
            check_booleans(tensors)
        except ValueError as error:
            raise malformed_message(str(error)) from None
        return Parts(tensors)

    def write(self, tensors: Mapping[str, Tensor], others: Mapping[str, Any]) -> bytes | None:
        """Return arrays as bytes, padded; None if a tensor has another dtype or shape.

        Args:
            tensors: some of the arrays.
            others: all others, of the right shape.
        """
        record = np.zeros((), self._record)
        for name, tensor in tensors.items():
            if (tensor.dtype, tensor.shape) != self._shapes[name]:
                return None
            record[name] = tensor.flat()
        for name, array in others.items():
            record[name] = array
        return record.tobytes()


def _flat(shape: tuple[int, ...]) -> tuple[int, ...]:
    return (math.prod(shape),) if shape else ()


# What a step returns of each sub-environment besides its observation.
_EACH: spaces.Shapes = {
    "reward": ("F64", ()),
    "terminated": ("BOOL", ()),
    "truncated": ("BOOL", ()),
}


class StreamLayout:
    """The layouts of the messages about one instance."""

    def __init__(self, instance: Instance, by_column: bool, as_float64: bool) -> None:
        """Find what has a fixed size.

        Args:
            instance: the instance.
            by_column: whether arrays in answers are transposed, see ``COLUMN_TENSORS``.
            as_float64: whether all numbers in answers are float64, if it can represent them.
        """
        self.num_envs = instance.config.num_envs
        self._by_column = by_column
        self._as_float64 = as_float64 and _fits_float64(instance.single_observation_space)
        self._action = spaces.tensor_shapes(instance.single_action_space, "action", short=True)
        self._observation = spaces.tensor_shapes(instance.single_observation_space, "observation")
        # Sub-environments end one after another, so the numbers of rows follow each other.
        self.action = lru_cache(_MOST_LAYOUTS)(self._of_action)
        self._step = lru_cache(_MOST_LAYOUTS)(self._of_step)
        self._reset = self._of_answer({}, self.num_envs)

    def first_message(self) -> bytes:
        """Return the message that tells a client the layout."""
        step = self._step(self.num_envs)
        parts = {"action": self.action(self.num_envs), "step": step, "reset": self._reset}
        tables = {name: part and part.table for name, part in parts.items()}
        return dumps({"num_envs": self.num_envs, **tables})

    def padded(self, body: bytes) -> bytes:
        """Return JSON that is not smaller than the arrays that a client expects."""
        step = self._step(self.num_envs)
        return body.ljust(_FEWEST_BYTES if step is None else step.padded_size)

    def arrays(self, result: dict[str, Any]) -> bytes | None:
        """Return the arrays of a step's or a reset's result; None if they have other sizes."""
        if self._observation is None or "final_obs" in result:
            return None
        each = {name: result[name] for name in _EACH if name in result}
        layout = self._reset
        if each:
            layout = self._step(None if self.num_envs is None else len(each["reward"]))
        assert layout is not None
        return layout.write(result["observation"].tensors, each)

    def _of_action(self, rows: int | None) -> ArrayLayout | None:
        """Return the layout of the actions of so many rows; None if their size varies."""
        return None if self._action is None else ArrayLayout(_batched(self._action, rows))

    def _of_step(self, rows: int | None) -> ArrayLayout | None:
        return self._of_answer(_EACH, rows)

    def _of_answer(self, others: spaces.Shapes, rows: int | None) -> ArrayLayout | None:
        if self._observation is None:
            return None
        shapes = _batched({**self._observation, **others}, rows)
        if self._by_column:
            shapes = {name: (dtype, shape[::-1]) for name, (dtype, shape) in shapes.items()}
        return ArrayLayout(shapes, self._as_float64)


def _fits_float64(space: Space) -> bool:
    """Return whether float64 can represent the numbers of all members."""
    match space:
        case Tuple() | Dict():
            return all(map(_fits_float64, spaces.parts_of(space)))
        case Discrete():
            return abs(int(space.start)) + int(space.n) <= 2**53
        case _:
            dtype = space.dtype
            return dtype is not None and (dtype.kind == "f" or dtype.itemsize < 8)


def _batched(shapes: spaces.Shapes, rows: int | None) -> spaces.Shapes:
    if rows is None:
        return shapes
    return {name: (dtype, (rows, *shape)) for name, (dtype, shape) in shapes.items()}
