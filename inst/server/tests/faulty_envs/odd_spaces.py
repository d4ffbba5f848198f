"""Environments with spaces and values that the classic ones lack."""

import numpy as np
from gymnasium import spaces

from faulty_envs.counting import Counting


class Echo(Counting):
    """Observes its last action; the kwargs define its Box."""

    def __init__(self, dtype="float32", low=-1, high=1, shape=(1,)):
        super().__init__()
        low, high = (_bound(bound) for bound in (low, high))
        box = spaces.Box(low, high, tuple(shape), np.dtype(dtype).type)
        self.action_space = self.observation_space = box

    def observe(self):
        return self.observation_space.low

    def step(self, action):
        info = {"dtype": action.dtype.name, "shape": action.shape}
        return action, 0.0, False, False, info


def _bound(bound):
    return (
        np.array(bound) if isinstance(bound, list) else float(bound) if bound in _NAMED else bound
    )


_NAMED = ("inf", "-inf")


class Shifted(Counting):
    """Has a Discrete space that does not start at 0."""

    action_space = spaces.Discrete(3, start=-1)

    def step(self, action):
        return self.observe(), float(action), False, False, {"type": type(action).__name__}


class NotANumber(Counting):
    """Returns everything that JSON cannot express."""

    observation_space = spaces.Box(-np.inf, np.inf, (4,), np.float32)

    def observe(self):
        return np.array([np.nan, np.inf, -np.inf, 0.1], dtype=np.float32)

    def step(self, action):
        itself = []
        itself.append(itself)
        info = {
            "array": np.array([[1, 2], [3, 4]], dtype=np.uint8),
            "nan": np.float64("nan"),
            "flag": np.bool_(True),
            "big": np.int64(2**62),
            "object": object,
            7: {"nested": (np.float32(0.5), {1})},
            "itself": itself,
        }
        return self.observe(), float("inf"), np.bool_(False), np.bool_(False), info


class Nested(Counting):
    """Observes its last action, with all kinds of spaces that can be sent as tensors."""

    action_space = observation_space = spaces.Dict(
        {
            "a/b~": spaces.Tuple([spaces.Discrete(3, start=-1), spaces.Box(0, 1, (1,), float)]),
            "pixels": spaces.Box(0, 255, (2, 2), np.uint8),
            "word": spaces.Text(2, charset="aä"),
        }
    )

    def observe(self):
        self.observation_space.seed(0)
        return self.observation_space.sample()

    def step(self, action):
        return action, 0.0, False, False, {}


class Letters(Counting):
    """Has spaces that are sent as JSON only."""

    action_space = observation_space = spaces.Sequence(spaces.Discrete(26))

    def observe(self):
        return (1, 2)

    def step(self, action):
        return action, 0.0, False, False, {}


SPACES = {
    "Box": spaces.Box(-np.inf, np.inf, (2, 3), np.float32),
    "bytes": spaces.Box(0, 254, (4,), np.uint8),
    "half": spaces.Box(-1, 1, (1,), np.float16),
    "bare": spaces.Box(-1, 1, (), np.float64),
    "Discrete": spaces.Discrete(5, start=-2),
    "MultiDiscrete": spaces.MultiDiscrete([[3, 4], [5, 6]], start=[[0, 1], [2, 3]]),
    "MultiBinary": spaces.MultiBinary([2, 2]),
    "Text": spaces.Text(5, charset="abé"),
    "Tuple": spaces.Tuple([spaces.Discrete(3), spaces.Text(3), spaces.Box(0, 1, (2,), float)]),
    "Dict": Nested.action_space,
    "Sequence": spaces.Sequence(spaces.Box(0, 1, (2,), np.float32)),
    "stacked": spaces.Sequence(spaces.Discrete(4), stack=True),
    "Graph": spaces.Graph(spaces.Box(0, 1, (2,), np.float32), spaces.Discrete(3)),
    "OneOf": spaces.OneOf([spaces.Discrete(3), spaces.Box(0, 1, (2,), np.float32)]),
    "nothing": spaces.Dict({"a": spaces.Tuple([]), "b": spaces.Discrete(2)}),
    "mixed": spaces.Dict({"a": spaces.Sequence(spaces.Text(2)), "b": spaces.Discrete(3)}),
}


class OwnSpace(spaces.Space):
    def __repr__(self):
        return "OwnSpace()"


class CustomSpace(Counting):
    action_space = OwnSpace()


class Deep(Counting):
    """Has a deeply nested space."""

    def __init__(self, depth):
        super().__init__()
        self.observation_space = spaces.Discrete(2)
        for _ in range(depth):
            self.observation_space = spaces.Tuple([self.observation_space])

    def observe(self):
        return self.observation_space.sample()


class LongDouble(Counting):
    observation_space = spaces.Box(0, 1, (1,), np.longdouble)
