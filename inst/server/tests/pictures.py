"""Read PNG files. For tests."""

import io
import struct
import zlib

import numpy as np


def decode(data):
    """Decode a PNG with 8 bits and no filters."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    stream, chunks = io.BytesIO(data[8:]), {}
    while header := stream.read(8):
        length, name = struct.unpack(">I4s", header)
        chunks[name] = stream.read(length)
        assert struct.unpack(">I", stream.read(4))[0] == zlib.crc32(name + chunks[name])
    width, height, bits, colour = struct.unpack(">2I2B", chunks[b"IHDR"][:10])
    channels = {0: 1, 2: 3, 6: 4}[colour]
    rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(height, -1)
    assert bits == 8
    assert not rows[:, 0].any()
    return rows[:, 1:].reshape(height, width, channels)
