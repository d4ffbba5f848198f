"""Rendered frames as arrays and as PNG files."""

from __future__ import annotations

import struct
import zlib

import numpy as np

_COLOUR_TYPES = {1: 0, 3: 2, 4: 6}


def picture(frame: object) -> np.ndarray:
    """Copy a rendered frame to a uint8 array of shape (height, width, channels).

    Args:
        frame: uint8 array of shape (height, width), (height, width, 1), (height, width, 3) for
            RGB or (height, width, 4) for RGBA.

    Raises:
        ValueError: the frame is anything else.
    """
    if not isinstance(frame, np.ndarray):
        raise ValueError(f"no picture: {type(frame).__name__}")
    if frame.ndim == 2:
        frame = frame[:, :, np.newaxis]
    if frame.dtype != np.uint8 or frame.ndim != 3 or frame.shape[2] not in _COLOUR_TYPES:
        raise ValueError(f"no picture: {frame.dtype} of shape {frame.shape}")
    # The environment may draw over it before it is sent.
    copied: np.ndarray = frame.copy()
    return copied


def png(frame: np.ndarray) -> bytes:
    """Encode a ``picture()`` as a PNG file."""
    height, width, channels = frame.shape
    # Each row starts with its filter type: 0 is none.
    rows = np.zeros((height, 1 + width * channels), dtype=np.uint8)
    rows[:, 1:] = frame.reshape(height, width * channels)
    header = struct.pack(">2I5B", width, height, 8, _COLOUR_TYPES[channels], 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + _chunk(b"IHDR", header)
        + _chunk(b"IDAT", zlib.compress(rows.tobytes(), 1))
        + _chunk(b"IEND", b"")
    )


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
