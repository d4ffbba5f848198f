"""An environment with a random space that checks the actions it gets.

It shows a value of its space as the observation, and expects the same value as the action. The
reward is 1 if it is equal in type, dtype, shape and every bit except those of NaN; else 0, with
both values in the info. Made on a server that was started with
`--allow-module mirror_environments`.
"""

import string

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import concatenate, create_empty_array

SHAPES = [(), (1,), (4,), (1, 1), (2, 3), (3, 1), (0,), (0, 2), (2, 0), (2, 2, 2)]
# Gymnasium has no MultiBinary without elements.
BINARY_SHAPES = [shape for shape in SHAPES if shape and 0 not in shape]
INTEGERS = [np.int8, np.int16, np.int32, np.int64, np.uint8, np.uint16, np.uint32, np.uint64]
FLOATS = [np.float16, np.float32, np.float64]
KEYS = ["a", "b.c", "d/e", "f~g", "h i", "é", "漢", "$", 'a"b', "~1", "\\", "", "A", "0"]
CHARACTERS = string.ascii_letters + ' "\\/~.\n\té漢\U0001f600\u2028\x7f'


def _pick(rng, items):
    return items[rng.integers(len(items))]


def draw_space(rng, depth=3, kinds=None):
    """Return a random nested space."""
    kinds = kinds or list(DRAW)[: None if depth else 5]
    return DRAW[_pick(rng, kinds)](rng, depth)


def _box(rng, depth):
    shape = _pick(rng, SHAPES)
    dtype = _pick(rng, INTEGERS + FLOATS * 2 + [np.bool_])
    if dtype is np.bool_:
        return spaces.Box(0, 1, shape, dtype)
    if dtype in FLOATS:
        low, high = _pick(rng, [(-1, 1), (-np.inf, np.inf), (0, np.inf)])
        return spaces.Box(low, high, shape, dtype)
    limits = np.iinfo(dtype)
    return spaces.Box(limits.min, limits.max, shape, dtype)


def _discrete(rng, depth):
    start = _pick(rng, [0, -7, 2**53 - 2**41, -(2**52), 2**31 - 2])
    return spaces.Discrete(_pick(rng, [1, 2, 100, 2**40]), start=start)


def _multi_discrete(rng, depth):
    shape = _pick(rng, [shape for shape in SHAPES if shape])
    nvec = rng.integers(1, 2**33 if rng.integers(2) else 9, shape)
    return spaces.MultiDiscrete(nvec, start=rng.integers(-9, 9, shape))


def _parts(rng, depth, least=0):
    return [draw_space(rng, depth - 1) for _ in range(rng.integers(least, 4))]


def _dict(rng, depth):
    parts = _parts(rng, depth)
    return spaces.Dict(dict(zip(rng.permutation(KEYS).tolist(), parts, strict=False)))


def _graph(rng, depth):
    edges = draw_space(rng, 0, ["Box", "Discrete"]) if rng.integers(3) else None
    return spaces.Graph(draw_space(rng, 0, ["Box", "Discrete"]), edges)


DRAW = {
    "Box": _box,
    "Discrete": _discrete,
    "MultiDiscrete": _multi_discrete,
    "MultiBinary": lambda rng, depth: spaces.MultiBinary(_pick(rng, BINARY_SHAPES)),
    "Text": lambda rng, depth: spaces.Text(9, min_length=0, charset=CHARACTERS),
    "Tuple": lambda rng, depth: spaces.Tuple(_parts(rng, depth)),
    "Dict": _dict,
    "Sequence": lambda rng, depth: spaces.Sequence(
        draw_space(rng, depth - 1), stack=bool(rng.integers(2))
    ),
    "Graph": _graph,
    "OneOf": lambda rng, depth: spaces.OneOf(_parts(rng, depth, 1)),
}


def special_numbers(dtype):
    """Return numbers that `sample()` rarely returns."""
    if dtype.kind == "f":
        limits = np.finfo(dtype)
        tiny = limits.smallest_subnormal
        return [np.nan, np.inf, -np.inf, limits.max, limits.min, tiny, -tiny, -0.0, 0.1]
    if dtype.kind == "b":
        return [False, True]
    limits = np.iinfo(dtype)
    # R's numbers are exact below 2**53.
    wanted = [limits.min, limits.max, 0, 1, -(2**31), 2**31, 2**31 - 1, 2**32 - 1, 2**32]
    wanted += [2**53 - 1, 1 - 2**53]
    return [n for n in wanted if limits.min <= n <= limits.max and -(2**53) < n < 2**53]


def draw_value(rng, space):
    """Return a member of a space, with some special values."""
    match space:
        case spaces.Box():
            array = np.array(space.sample(), dtype=space.dtype).reshape(space.shape)
            specials = np.array(special_numbers(space.dtype)).astype(space.dtype)
            chosen = rng.choice(specials, space.shape)
            some = rng.random(space.shape) < rng.choice([0, 0.3, 1])
            array = np.where(some, chosen, array).astype(space.dtype).reshape(space.shape)
            if space.dtype.kind in "iu" and space.dtype.itemsize == 8:
                # See special_numbers().
                array[abs(array.astype(float)) >= 2**53] = 7
            return array
        case spaces.MultiDiscrete():
            edges = [space.start, space.start + (space.nvec - 1), space.sample()]
            return _pick(rng, edges).astype(space.dtype)
        case spaces.Tuple():
            return tuple(draw_value(rng, part) for part in space.spaces)
        case spaces.Dict():
            return {key: draw_value(rng, part) for key, part in space.spaces.items()}
        case spaces.Sequence():
            n = int(rng.integers(4))
            members = [draw_value(rng, space.feature_space) for _ in range(n)]
            return stack(space.feature_space, members) if space.stack else tuple(members)
        case spaces.OneOf():
            index = int(rng.integers(len(space.spaces)))
            return np.int64(index), draw_value(rng, space.spaces[index])
        case spaces.Graph():
            return _draw_graph(rng, space)
        case _:
            return space.sample()


def _draw_graph(rng, space):
    n = int(rng.integers(1, 4))
    nodes = stack(space.node_space, [draw_value(rng, space.node_space) for _ in range(n)])
    if space.edge_space is None or not rng.integers(3):
        return spaces.GraphInstance(nodes, None, None)
    k = int(rng.integers(4))
    edges = stack(space.edge_space, [draw_value(rng, space.edge_space) for _ in range(k)])
    return spaces.GraphInstance(nodes, edges, rng.integers(n, size=(k, 2), dtype=np.int32))


def stack(space, members):
    """Batch members as Gymnasium does."""
    empty = create_empty_array(space, len(members))
    return concatenate(space, members, empty) if members else empty


def differs(sent, came):
    """Describe the difference, or return an empty text."""
    if type(sent) is not type(came):
        return f"{type(sent).__name__} became {type(came).__name__}"
    if isinstance(sent, (np.ndarray, np.generic)):
        if (sent.dtype, sent.shape) != (came.dtype, came.shape):
            return f"{sent.dtype} {sent.shape} became {came.dtype} {came.shape}"
        same = (sent == came) | ((sent != sent) & (came != came))
        if sent.dtype.kind == "f":
            same &= (np.signbit(sent) == np.signbit(came)) | np.isnan(sent)
        return "" if np.all(same) else f"{sent!r} became {came!r}"
    if isinstance(sent, dict):
        if sent.keys() != came.keys():
            return f"{list(sent)} became {list(came)}"
        return "".join(differs(sent[key], came[key]) for key in sent)
    if isinstance(sent, tuple):
        if len(sent) != len(came):
            return f"{len(sent)} parts became {len(came)}"
        return "".join(map(differs, sent, came))
    return "" if sent == came else f"{sent!r} became {came!r}"


class Boundless(np.ndarray):
    """A bound that contains everything, even NaN, which no ordinary Box contains."""

    def __le__(self, other):
        return np.ones(np.shape(other), bool)

    __ge__ = __le__


def unbind(space):
    """Make NaN a member of the floating-point Boxes in a space."""
    if isinstance(space, spaces.Box) and space.dtype.kind == "f":
        space.low, space.high = space.low.view(Boundless), space.high.view(Boundless)
    parts = getattr(space, "spaces", ())
    for part in parts.values() if isinstance(parts, dict) else parts:
        unbind(part)
    for name in ("feature_space", "node_space", "edge_space"):
        if getattr(space, name, None) is not None:
            unbind(getattr(space, name))


class Mirror(gym.Env):
    """Shows values one after another, starts with the one of its seed, and ends at last."""

    def __init__(self, number, values):
        rng = np.random.default_rng(number)
        self.observation_space = self.action_space = draw_space(rng)
        self.action_space.seed(number)
        self._values = [draw_value(rng, self.action_space) for _ in range(values)]
        unbind(self.action_space)
        self._first = self._at = 0

    def _shown(self):
        return self._values[(self._first + self._at) % len(self._values)]

    def reset(self, *, seed=None, options=None):
        self._first, self._at = seed or 0, 0
        return self._shown(), {}

    def step(self, action):
        problem = differs(self._shown(), action)
        self._at += 1
        last = self._at == len(self._values)
        observation = self._shown()
        info = {"problem": problem} if problem else {}
        return observation, float(not problem), last, False, info


gym.register("Mirror-v0", entry_point=Mirror, disable_env_checker=True)
