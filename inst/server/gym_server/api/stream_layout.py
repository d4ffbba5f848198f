"""The messages of a stream: their heads, and the places of arrays whose size never changes.

The arrays are those of a safetensors file for the same request, without the file's header.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

from gym_server import spaces
from gym_server.errors import GymServerError
from gym_server.instances.instance import Instance
from gym_server.protocol.answers import FLAGS, dumps
from gym_server.protocol.safetensors import Parts, Tensor, check_booleans, places

# Of a client's message: what it asks for, the form of the rest, flags, and the request's number.
REQUEST_HEAD = struct.Struct("<BBHxxxxd")
# Of an answer: the form of the rest, the status in HTTP's words, the size of the JSON at the end,
# and the request's number.
ANSWER_HEAD = struct.Struct("<BxHId")

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

    def __init__(self, shapes: spaces.Shapes) -> None:
        """Place the arrays."""
        self._shapes = shapes
        self.table = places((name, *shape) for name, shape in shapes.items())
        self.size = max((entry["data_offsets"][1] for entry in self.table.values()), default=0)

    def read(self, data: bytes) -> Parts:
        """Return the arrays of a message.

        Raises:
            GymServerError: ``malformed_message``.
        """
        if len(data) != self.size:
            raise malformed_message(f"its arrays have {len(data)} bytes, not {self.size}")
        view = memoryview(data)
        tensors = {
            name: Tensor(entry["dtype"], entry["shape"], view[slice(*entry["data_offsets"])])
            for name, entry in self.table.items()
        }
        try:
            check_booleans(tensors)
        except ValueError as error:
            raise malformed_message(str(error)) from None
        return Parts(tensors)

    def write(self, tensors: Mapping[str, Tensor]) -> bytes | None:
        """Return arrays as bytes; None if one has another dtype or shape."""
        for name, (dtype, shape) in self._shapes.items():
            tensor = tensors[name]
            if tensor.dtype != dtype or tensor.shape != shape:
                return None
        return b"".join([tensors[name].data for name in self.table])


class StreamLayout:
    """The layouts of the messages about one instance."""

    def __init__(self, instance: Instance, by_column: bool) -> None:
        """Find what has a fixed size.

        Args:
            instance: the instance.
            by_column: whether arrays in answers are transposed, see ``COLUMN_TENSORS``.
        """
        self.num_envs = instance.config.num_envs
        self._by_column = by_column
        self._action = spaces.tensor_shapes(instance.single_action_space, "action")
        self._observation = spaces.tensor_shapes(instance.single_observation_space, "observation")
        # By the number of rows: those of all sub-environments, and of the last mask.
        self._actions: dict[int | None, ArrayLayout] = {}
        self._steps: dict[int | None, ArrayLayout] = {}
        self._reset = self._of_answer({}, self.num_envs)

    def first_message(self) -> bytes:
        """Return the message that tells a client the layout."""
        step = self._of_step(self.num_envs)
        parts = {"action": self.action(self.num_envs), "step": step, "reset": self._reset}
        tables = {name: part and part.table for name, part in parts.items()}
        return dumps({"num_envs": self.num_envs, **tables})

    def action(self, rows: int | None) -> ArrayLayout | None:
        """Return the layout of the actions of so many rows; None if their size varies."""
        if self._action is None:
            return None
        layout = self._actions.get(rows)
        if layout is None:
            layout = ArrayLayout(_batched(self._action, rows))
            _remember(self._actions, rows, layout)
        return layout

    def arrays(self, result: dict[str, Any]) -> bytes | None:
        """Return the arrays of a step's or a reset's result; None if they have other sizes."""
        if self._observation is None or "final_obs" in result:
            return None
        reward = result.get("reward")
        if reward is None:
            return None if self._reset is None else self._reset.write(result["observation"].tensors)
        tensors = dict(result["observation"].tensors)
        rows = None if self.num_envs is None else len(reward)
        layout = self._of_step(rows)
        assert layout is not None
        if rows is None:
            tensors["reward"] = Tensor("F64", (), struct.pack("<d", reward))
            tensors["terminated"] = FLAGS[result["terminated"]]
            tensors["truncated"] = FLAGS[result["truncated"]]
        else:
            tensors["reward"] = Tensor.of(np.asarray(reward, np.float64))
            tensors["terminated"] = Tensor.of(result["terminated"])
            tensors["truncated"] = Tensor.of(result["truncated"])
        return layout.write(tensors)

    def _of_step(self, rows: int | None) -> ArrayLayout | None:
        layout = self._steps.get(rows)
        if layout is None:
            each: spaces.Shapes = {
                "reward": ("F64", ()),
                "terminated": ("BOOL", ()),
                "truncated": ("BOOL", ()),
            }
            layout = self._of_answer(each, rows)
            if layout is not None:
                _remember(self._steps, rows, layout)
        return layout

    def _of_answer(self, others: spaces.Shapes, rows: int | None) -> ArrayLayout | None:
        if self._observation is None:
            return None
        shapes = _batched({**self._observation, **others}, rows)
        if self._by_column:
            shapes = {name: (dtype, shape[::-1]) for name, (dtype, shape) in shapes.items()}
        return ArrayLayout(shapes)


def _batched(shapes: spaces.Shapes, rows: int | None) -> spaces.Shapes:
    if rows is None:
        return shapes
    return {name: (dtype, (rows, *shape)) for name, (dtype, shape) in shapes.items()}


# Sub-environments end one after another, so the numbers of rows follow each other.
_MOST_LAYOUTS = 8


def _remember(layouts: dict[int | None, ArrayLayout], rows: int | None, one: ArrayLayout) -> None:
    if len(layouts) >= _MOST_LAYOUTS:
        layouts.clear()
    layouts[rows] = one
