"""Random nested spaces, their members, and a comparison of members.

For tests. Members come from Gymnasium's ``sample()``, plus values that it never returns: NaN,
infinities, the ends of every dtype, subnormals, empty sequences.
"""

import numpy as np
from gymnasium.spaces import (
    Box,
    Dict,
    Discrete,
    Graph,
    GraphInstance,
    MultiBinary,
    MultiDiscrete,
    OneOf,
    Sequence,
    Text,
    Tuple,
)

from gym_server.spaces.stacking import stack

SHAPES = [(), (1,), (3,), (0,), (2, 0), (2, 3), (1, 1, 2), (1, 1)]
FLOATS = [np.float16, np.float32, np.float64]
INTEGERS = [np.int8, np.int16, np.int32, np.int64, np.uint8, np.uint16, np.uint32, np.uint64]
CHARACTERS = ["ab", "äöü☃", "日本語", '"\\/', "\U0001f600\n\t", "'`$[]~."]
KEYS = ["a", "a.b", "x/y", "~t", "~1", "", "é☃", "with space", "0", "action", "observation"]


def pick(rng, items):
    return items[rng.integers(len(items))]


def random_space(rng, depth=3, tensors=False):
    """Return a space; with ``tensors``, one whose members can be sent as tensors."""
    leaves = [_discrete, _box, _multi_discrete, _multi_binary, _text]
    nests = [_tuple, _dict] if tensors else [_tuple, _dict, _sequence, _graph, _one_of]
    make = pick(rng, leaves if depth == 0 or rng.random() < 0.25 else nests)
    return make(rng, depth - 1, tensors)


def _discrete(rng, depth, tensors):
    dtype = pick(rng, INTEGERS)
    unsigned = np.issubdtype(dtype, np.unsignedinteger)
    start = 0 if unsigned or rng.random() < 0.5 else -int(rng.integers(1, 5))
    return Discrete(int(rng.integers(1, 9)), start=start, dtype=dtype)


def _box(rng, depth, tensors):
    shape = pick(rng, SHAPES)
    kind = rng.integers(4)
    if kind == 0:
        return Box(-np.inf, np.inf, shape, pick(rng, FLOATS))
    if kind == 1:
        dtype = pick(rng, INTEGERS)
        limits = np.iinfo(dtype)
        full = (np.full(shape, limit, dtype) for limit in (limits.min, limits.max))
        return Box(*full, shape, dtype)
    if kind == 2:
        return Box(0, 1, shape, bool)
    dtype = pick(rng, FLOATS)
    low = rng.uniform(-5, 0, shape).astype(dtype)
    return Box(np.asarray(low), np.asarray(low + dtype(3)), shape, dtype)


def _multi_discrete(rng, depth, tensors):
    shape = pick(rng, [(1,), (3,), (2, 3)])
    start = rng.integers(-5, 5, shape) if rng.random() < 0.5 else None
    dtype = pick(rng, [np.int64, np.int32, np.int8])
    return MultiDiscrete(rng.integers(1, 6, shape), dtype=dtype, start=start)


def _multi_binary(rng, depth, tensors):
    return MultiBinary(pick(rng, [1, 4, [2, 3], [1, 1]]))


def _text(rng, depth, tensors):
    return Text(
        int(rng.integers(1, 9)), min_length=int(rng.integers(2)), charset=pick(rng, CHARACTERS)
    )


def _tuple(rng, depth, tensors):
    return Tuple([random_space(rng, depth, tensors) for _ in range(rng.integers(4))])


def _dict(rng, depth, tensors):
    keys = rng.permutation(KEYS)[: rng.integers(4)]
    return Dict([(str(key), random_space(rng, depth, tensors)) for key in keys])


def _sequence(rng, depth, tensors):
    feature = random_space(rng, depth)
    return Sequence(feature, stack=bool(rng.random() < 0.5) and _is_array(feature))


def _graph(rng, depth, tensors):
    node, edge = (pick(rng, [_box, _discrete])(rng, depth, tensors) for _ in range(2))
    return Graph(node, edge if rng.random() < 0.7 else None)


def _one_of(rng, depth, tensors):
    return OneOf([random_space(rng, depth) for _ in range(rng.integers(1, 4))])


def _is_array(space):
    return isinstance(space, (Box, Discrete, MultiBinary, MultiDiscrete))


def random_member(rng, space):
    """Return a member of a space; its floats may be NaN."""
    if rng.random() < 0.2 and not _has_full_integers(space):
        space.seed(int(rng.integers(2**31)))
        return space.sample()
    match space:
        case Tuple():
            return tuple(random_member(rng, part) for part in space.spaces)
        case Dict():
            return {key: random_member(rng, part) for key, part in space.spaces.items()}
        case Sequence():
            members = _members(rng, space.feature_space, 4)
            return stack(space.feature_space, members) if space.stack else tuple(members)
        case Graph():
            return _random_graph(rng, space)
        case OneOf():
            index = rng.integers(len(space.spaces))
            return np.int64(index), random_member(rng, space.spaces[index])
        case Box():
            return _random_array(rng, space)
        case _:
            space.seed(int(rng.integers(2**31)))
            return space.sample()


def _members(rng, space, most):
    return [random_member(rng, space) for _ in range(rng.integers(most))]


def _random_graph(rng, space):
    nodes = _members(rng, space.node_space, 5)
    edges = links = None
    if space.edge_space is not None and nodes and rng.random() < 0.8:
        items = _members(rng, space.edge_space, 4)
        edges = stack(space.edge_space, items)
        links = rng.integers(0, len(nodes), (len(items), 2)).astype(np.int32)
    return GraphInstance(stack(space.node_space, nodes), edges, links)


def _random_array(rng, space):
    if _has_full_integers(space):
        limits = np.iinfo(space.dtype)
        array = rng.integers(limits.min, limits.max, space.shape, space.dtype, endpoint=True)
        special = [limits.min, limits.max, 0, 1]
        special += [2**53 + 1, 2**62 + 1, -(2**53) - 1, -(2**31), 2**31]
        special = [number for number in special if limits.min <= number <= limits.max]
    else:
        space.seed(int(rng.integers(2**31)))
        array = space.sample()
        if space.dtype.kind != "f" or np.isfinite(space.low).any():
            return array
        limits = np.finfo(space.dtype)
        special = [np.nan, np.inf, -np.inf, limits.max, limits.min, -0.0, 0.1]
        special += [limits.tiny, limits.smallest_subnormal, -limits.smallest_subnormal]
    array = np.array(array, space.dtype)
    flat = array.reshape(-1)
    for index in range(flat.size):
        if rng.random() < 0.4:
            flat[index] = pick(rng, special)
    return array


def _has_full_integers(space):
    """Return whether sample() fails, because it adds 1 to the largest integer."""
    match space:
        case Box():
            return space.dtype.kind in "iu"
        case Tuple() | OneOf():
            return any(map(_has_full_integers, space.spaces))
        case Dict():
            return any(map(_has_full_integers, space.spaces.values()))
        case Sequence():
            return _has_full_integers(space.feature_space)
        case Graph():
            parts = (space.node_space, space.edge_space)
            return any(_has_full_integers(part) for part in parts if part is not None)
        case _:
            return False


def same(one, other):
    """Return whether two members are equal in value, dtype and shape."""
    if isinstance(one, (np.ndarray, np.generic)):
        # Gymnasium itself samples a Box without dimensions as a scalar or as an array.
        return (
            isinstance(other, (np.ndarray, np.generic))
            and (one.dtype, one.shape) == (other.dtype, other.shape)
            and _same_numbers(one, other)
        )
    if type(one) is not type(other):
        return False
    if isinstance(one, dict):
        return list(one) == list(other) and all(same(one[key], other[key]) for key in one)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    return one == other


def _same_numbers(one, other):
    if one.dtype.kind != "f":
        return np.array_equal(one, other)
    signs = np.isnan(one) | (np.signbit(one) == np.signbit(other))
    return np.array_equal(one, other, equal_nan=True) and bool(np.all(signs))
