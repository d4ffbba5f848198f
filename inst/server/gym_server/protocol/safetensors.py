"""Tensors as bytes: a safetensors file, read strictly and written in a fixed order.

A file is 8 bytes with the length of its header, the header (JSON: dtype, shape and offsets of each
tensor, and texts as metadata), and the tensors' little-endian bytes. See
https://huggingface.co/docs/safetensors. PyPI's ``safetensors`` takes twice as long for a small
response, orders the header differently in each process, and accepts ambiguous files.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from gym_server.errors import GymServerError

TENSORS = "application/x-safetensors"

# Arrays are in column-major order, as in R and Fortran. A file is row-major by definition, so a
# tensor with two or more dimensions is transposed and its shape reversed.
COLUMN_TENSORS = f"{TENSORS}; order=column"

_LARGEST_HEADER = 2**20

_NAMES = {
    "f2": "F16",
    "f4": "F32",
    "f8": "F64",
    "i1": "I8",
    "i2": "I16",
    "i4": "I32",
    "i8": "I64",
    "u1": "U8",
    "u2": "U16",
    "u4": "U32",
    "u8": "U64",
    "b1": "BOOL",
}
DTYPES = {name: np.dtype(code).newbyteorder("<") for code, name in _NAMES.items()}
_NATIVE = {name: np.dtype(code) for code, name in _NAMES.items()}
# By dtypes of little-endian numbers, because their texts take longer to make than to copy an array.
_NAMES_OF_LITTLE = {dtype: name for name, dtype in DTYPES.items()}


def tensor_name(dtype: np.dtype) -> str:
    """Return the format's name for a supported dtype."""
    return _NAMES[dtype.str[1:]]


class Tensor(NamedTuple):
    """An array in a file; only ``array()`` looks at its bytes."""

    dtype: str
    shape: tuple[int, ...]
    data: bytes | memoryview

    @classmethod
    def of(cls, array: np.ndarray, by_column: bool = False) -> Tensor:
        """Copy an array.

        Args:
            array: the array. KeyError is raised if the format has no name for its dtype.
            by_column: whether to transpose it, see ``COLUMN_TENSORS``.
        """
        name = _NAMES_OF_LITTLE.get(array.dtype)
        if name is None:
            name = tensor_name(array.dtype)
            array = array.astype(DTYPES[name])
        if array.ndim < 2:
            return cls(name, array.shape, array.tobytes())
        if by_column:
            array = array.T
        if array.ndim == 2 and array.flags.f_contiguous and array.shape[1] <= _FEW_COLUMNS:
            array = _by_rows(array)
        return cls(name, array.shape, array.tobytes())

    def array(self) -> np.ndarray:
        """Return a copy of the array in native byte order."""
        return self.flat().reshape(self.shape).astype(_NATIVE[self.dtype])

    def flat(self) -> np.ndarray:
        """Return the numbers in the order of their bytes."""
        return np.frombuffer(self.data, DTYPES[self.dtype])


@dataclass(slots=True)
class Parts:
    """A member or batch of a space, in parts.

    Attributes:
        tensors: the numeric parts by name.
        texts: the texts by name.
        by_column: whether the tensors are transposed, see ``COLUMN_TENSORS``.
    """

    tensors: dict[str, Tensor] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    by_column: bool = False


_FEW_COLUMNS = 16


def _by_rows(array: np.ndarray) -> np.ndarray:
    """Copy a column-major array, such as CartPole's, to rows; faster than NumPy."""
    rows = np.empty(array.shape, array.dtype)
    for column in range(array.shape[1]):
        rows[:, column] = array[:, column]
    return rows


class TensorFile(NamedTuple):
    """The contents of a file."""

    tensors: dict[str, Tensor]
    metadata: dict[str, str]


def write(tensors: Mapping[str, Tensor], metadata: Mapping[str, str]) -> bytes:
    """Return tensors and metadata as a file; see ``join()``."""
    return join(tensors, quoted(metadata))


def quoted(metadata: Mapping[str, str]) -> bytes:
    """Return metadata as they appear in a header."""
    return _encode(metadata)[1:-1].encode("ascii")


def join(tensors: Mapping[str, Tensor], metadata: bytes) -> bytes:
    """Return tensors and metadata as a file.

    The metadata comes last in the header. The part before it depends only on names, dtypes and
    shapes, so a reader can recognize it.

    Args:
        tensors: the tensors by name.
        metadata: results of ``quoted()``, joined by commas.
    """
    names, beginning = _layout(
        tuple([(name, tensor.dtype, tensor.shape) for name, tensor in tensors.items()])
    )
    header = b'%b"__metadata__":{%b}}' % (beginning, metadata)
    return b"".join((*_headed(header), *[tensors[name].data for name in names]))


def _headed(header: bytes) -> tuple[bytes, bytes]:
    """Pad a header; return its length as bytes, and the header."""
    header += b" " * (-len(header) % 8)
    return len(header).to_bytes(8, "little"), header


_encode = json.JSONEncoder(separators=(",", ":")).encode


def places(entries: Iterable[tuple[str, str, tuple[int, ...]]]) -> dict[str, dict[str, Any]]:
    """Return the header of a file without metadata, in the order of its tensors.

    Args:
        entries: the name, dtype and shape of each tensor.
    """
    header: dict[str, dict[str, Any]] = {}
    begin = 0
    # The widest dtypes first, so that all tensors are aligned.
    for name, dtype, shape in sorted(entries, key=lambda entry: -DTYPES[entry[1]].itemsize):
        end = begin + math.prod(shape) * DTYPES[dtype].itemsize
        header[name] = {"dtype": dtype, "shape": shape, "data_offsets": (begin, end)}
        begin = end
    return header


# All steps of an environment have the same.
@lru_cache(maxsize=256)
def _layout(entries: tuple[tuple[str, str, tuple[int, ...]], ...]) -> tuple[list[str], bytes]:
    """Return the order of tensors in a file, and the header before its metadata."""
    header = places(entries)
    beginning = _encode(header)[:-1] + "," if header else "{"
    return list(header), beginning.encode("ascii")


def read(raw: bytes) -> TensorFile:
    """Read a file. The sizes in its header are checked before anything is allocated.

    Raises:
        GymServerError: ``malformed_tensors`` if the file violates the format in any way.
    """
    try:
        return _read(raw)
    except (ValueError, RecursionError) as error:
        raise malformed_tensors(str(error)) from None


def malformed_tensors(reason: str) -> GymServerError:
    """Report a body that is not a safetensors file, or not the required one."""
    return GymServerError("malformed_tensors", f"The request's tensors cannot be read: {reason}")


def _read(raw: bytes) -> TensorFile:
    if len(raw) < 8:
        raise ValueError(f"{len(raw)} bytes are too few")
    length = int.from_bytes(raw[:8], "little")
    if length > min(_LARGEST_HEADER, len(raw) - 8):
        raise ValueError(
            f"a header of {length} bytes in a body of {len(raw)} "
            f"(and {_LARGEST_HEADER} is the most)"
        )
    header = _header.decode(raw[8 : 8 + length].decode("utf-8"))
    if not isinstance(header, dict):
        raise ValueError("the header is not a JSON object")
    metadata = header.pop("__metadata__", {})
    if not isinstance(metadata, dict) or not all(isinstance(v, str) for v in metadata.values()):
        raise ValueError("the metadata must be texts")
    data = memoryview(raw)[8 + length :]
    tensors = {name: _tensor(name, entry, data) for name, entry in header.items()}
    offsets = sorted(entry["data_offsets"] for entry in header.values())
    if [0, *(end for _, end in offsets)] != [*(begin for begin, _ in offsets), len(data)]:
        raise ValueError(f"there is a gap or an overlap in its {len(data)} bytes of tensors")
    check_booleans(tensors)
    return TensorFile(tensors, metadata)


def _tensor(name: str, entry: object, data: memoryview) -> Tensor:
    match entry:
        case {"dtype": str(dtype), "shape": [*shape], "data_offsets": [begin, end], **others} if (
            not others
            and dtype in DTYPES
            and all(type(number) is int and number >= 0 for number in (*shape, begin, end))
            and end - begin == math.prod(shape) * DTYPES[dtype].itemsize
        ):
            return Tensor(dtype, tuple(shape), data[begin:end])
    raise ValueError(
        f"tensor {name!r} needs a dtype ({', '.join(DTYPES)}), a shape, data_offsets that fit "
        "these, and nothing else"
    )


def check_booleans(tensors: Mapping[str, Tensor]) -> None:
    """Raise ValueError if a boolean is neither 0 nor 1."""
    for name, tensor in tensors.items():
        if tensor.dtype == "BOOL" and np.any(np.frombuffer(tensor.data, np.uint8) > 1):
            raise ValueError(f"tensor {name!r} has booleans that are neither 0 nor 1")


def _unique(pairs: list[tuple[str, object]]) -> dict:
    result = dict(pairs)
    if len(result) < len(pairs):
        raise ValueError("the header has a name twice")
    return result


_header = json.JSONDecoder(object_pairs_hook=_unique)
