"""Combine tensors with a row per episode or per step."""

from __future__ import annotations

from collections.abc import Sequence

from gym_server.protocol.safetensors import Tensor


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
