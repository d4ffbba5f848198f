"""Combine tensors with a row per episode or per step."""

from __future__ import annotations

from collections.abc import Sequence

from gym_server.protocol.safetensors import COLUMN_TENSORS, TENSORS, Tensor, write
from gym_server.response import Response


def concatenated(files: Sequence[dict[str, Tensor]]) -> dict[str, Tensor]:
    """Concatenate tensors of the same name."""
    if len(files) == 1:
        return files[0]
    tensors = {}
    for name in files[0] if files else ():
        parts = [file[name] for file in files]
        # Tensors without rows may have another width.
        rows = [part for part in parts if part.shape[0]] or parts[:1]
        first = rows[0]
        shape = (sum(part.shape[0] for part in rows), *first.shape[1:])
        tensors[name] = Tensor(first.dtype, shape, b"".join([part.data for part in rows]))
    return tensors


def content(tensors: dict[str, Tensor], metadata: dict[str, str], by_column: bool) -> Response:
    """Return tensors as a response."""
    if by_column:
        tensors = {name: Tensor.of(one.array(), by_column) for name, one in tensors.items()}
    file = write(tensors, metadata)
    return Response(200, file, COLUMN_TENSORS if by_column else TENSORS)
