"""Files that a reader never sees half-written."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gym_server.protocol import safetensors


def write(path: Path, content: bytes) -> None:
    """Replace a file."""
    new = path.with_name(path.name + ".new")
    new.write_bytes(content)
    os.replace(new, path)


def write_json(path: Path, value: Any) -> None:
    """Replace a file by a JSON document."""
    write(path, json.dumps(value).encode())


def write_tensors(path: Path, tensors: Mapping[str, Any], about: Any) -> None:
    """Replace a file by tensors and one JSON document about them."""
    parts = {
        name: safetensors.Tensor.of(np.ascontiguousarray(np.asarray(value, order="C")))
        for name, value in tensors.items()
    }
    write(path, safetensors.write(parts, {"about": json.dumps(about)}))
