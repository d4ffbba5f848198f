"""Spaces in requests and responses: describe them, encode their members, decode client values.

Each of the three is a ``functools.singledispatch`` function. Every kind of space registers its
implementations in a file of its name. ``tensor_parts`` encodes and decodes members as tensors.
"""

from gym_server.protocol.safetensors import Parts

# Importing a kind registers its functions.
from gym_server.spaces import (  # noqa: F401
    box,
    dict_,
    discrete,
    graph,
    multi_binary,
    multi_discrete,
    one_of,
    sequence,
    text,
    tuple_,
)
from gym_server.spaces.batches import (
    decode_sub_envs,
    encode_batch,
)
from gym_server.spaces.kinds import (
    NotInSpace,
    brief_space,
    decode,
    encode,
    encode_members,
    json_reader,
)
from gym_server.spaces.membership import contains
from gym_server.spaces.stacking import stack
from gym_server.spaces.support import describe, parts_of
from gym_server.spaces.tensor_parts import (
    Rows,
    Shapes,
    tensor_reader,
    tensor_shapes,
    tensor_writer,
    travels_as_tensors,
)

__all__ = [
    "NotInSpace",
    "Parts",
    "Rows",
    "Shapes",
    "brief_space",
    "contains",
    "decode",
    "decode_sub_envs",
    "describe",
    "encode",
    "encode_batch",
    "encode_members",
    "json_reader",
    "parts_of",
    "stack",
    "tensor_reader",
    "tensor_shapes",
    "tensor_writer",
    "travels_as_tensors",
]
