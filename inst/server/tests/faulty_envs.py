"""Environments that misbehave, or have spaces that the classic ones lack.

For tests: ``--allow-module faulty_envs`` lets a server make them, as in
``faulty_envs:Echo-v0``.  The module needs Gymnasium and nothing else.
"""

import contextlib
import copy
import ctypes
import os
import pickle
import signal
import stat
import sys
import threading
import time
from pathlib import Path

import gymnasium
import numpy as np
from gymnasium import spaces


class Counting(gymnasium.Env):
    """Observes how often it was stepped since it was made; an episode lasts ``length`` steps."""

    observation_space = spaces.Box(0, 2**62, (1,), np.int64)
    action_space = spaces.Discrete(2)

    def __init__(self, seconds=0.0, length=5):
        self.seconds, self.length = seconds, length
        self.steps = self.left = 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.left = self.length
        return self.observe(), {"seed": seed, "options": options}

    def step(self, action):
        time.sleep(self.seconds)
        self.steps += 1
        self.left -= 1
        return self.observe(), 1.5, self.left <= 0, False, {}

    def observe(self):
        return np.array([self.steps], dtype=np.int64)


class Hanging(Counting):
    def step(self, action):
        time.sleep(3600)


class Meeting(Counting):
    """A step waits until as many files lie in a directory as are to come, its own included."""

    def __init__(self, directory, count):
        super().__init__()
        self.directory, self.count = Path(directory), count

    def step(self, action):
        (self.directory / f"{os.getpid()}-{id(self)}").touch()
        end = time.monotonic() + 20
        while len(list(self.directory.iterdir())) < self.count:
            if time.monotonic() > end:
                raise RuntimeError("The others did not come")
            time.sleep(0.01)
        return super().step(action)


class HangsWhere(Counting):
    """Hangs for some seconds where its kwarg says: in "init", "reset", "render" or "close"."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 30}  # noqa: RUF012
    closed = 0

    def __init__(self, where, hours=1.0, render_mode=None):
        super().__init__()
        self.where, self.hours, self.render_mode = where, hours, render_mode
        self.hang("init")

    def hang(self, here):
        if self.where == here:
            time.sleep(3600 * self.hours)

    def reset(self, *, seed=None, options=None):
        self.hang("reset")
        return super().reset(seed=seed, options=options)

    def render(self):
        self.hang("render")
        return np.zeros((2, 2, 3), dtype=np.uint8)

    def close(self):
        self.hang("close")
        type(self).closed += 1


class Spins(Counting):
    """Loops without an end where its kwarg says: in "init", "step", "render" or "close"."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 30}  # noqa: RUF012

    def __init__(self, where, render_mode=None):
        super().__init__()
        self.where, self.render_mode = where, render_mode
        self.spin("init")

    def spin(self, here):
        while self.where == here:
            pass

    def step(self, action):
        self.spin("step")
        return super().step(action)

    def render(self):
        self.spin("render")
        return np.zeros((2, 2, 3), dtype=np.uint8)

    def close(self):
        self.spin("close")


class Echo(Counting):
    """Observes the action that it got; its Box is what the kwargs say."""

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


class Shifted(Counting):
    """A Discrete space that does not begin at 0."""

    action_space = spaces.Discrete(3, start=-1)

    def step(self, action):
        return self.observe(), float(action), False, False, {"type": type(action).__name__}


class NotANumber(Counting):
    """Everything that JSON has no word for."""

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


class RaisesInConstructor(Counting):
    def __init__(self):
        raise RuntimeError("no such table")


class RaisesInReset(Counting):
    def reset(self, *, seed=None, options=None):
        if not (options or {}).get("mend"):
            raise RuntimeError("the cart is gone")
        return super().reset(seed=seed, options=options)


class RaisesInStep(Counting):
    def step(self, action):
        if action == 1:
            raise ValueError("the pole broke")
        return super().step(action)


class ImportsInStep(Counting):
    def step(self, action):
        super().step(action)
        raise ImportError("the pole is not installed")


class ExitsInStep(Counting):
    def step(self, action):
        sys.exit("good bye")


class RaisesInClose(Counting):
    def close(self):
        raise RuntimeError("stuck")


class Drawing(Counting):
    """Draws what it was told to draw, and notes the threads that draw and close it."""

    threads = set()  # noqa: RUF012

    metadata = {"render_modes": ["rgb_array"], "render_fps": 30}  # noqa: RUF012

    def __init__(self, frame="picture", render_mode=None, **kwargs):
        super().__init__(**kwargs)
        self.frame, self.render_mode = frame, render_mode

    def close(self):
        self.threads.add(threading.get_ident())

    def render(self):
        self.threads.add(threading.get_ident())
        if self.frame == "hangs":
            time.sleep(3600)
        if self.frame == "raises":
            raise RuntimeError("out of paint")
        if self.frame == "nothing":
            return None
        return np.full((16, 32, 3), self.steps, dtype=np.uint8)


class OldRenderModes(Counting):
    metadata = {"render_modes": ["ansi"]}  # noqa: RUF012


class Nested(Counting):
    """Observes the action that it got, of all kinds that travel as tensors."""

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
    """Spaces that travel as JSON only."""

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


class Uneven(gymnasium.Env):
    """Its seed decides how long each episode lasts; its infos come and go."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 30}  # noqa: RUF012

    def __init__(self, space="Box", longest=4, render_mode=None):
        self.observation_space, self.action_space = (copy.deepcopy(SPACES[space]) for _ in "oa")
        self.longest, self.render_mode = longest, render_mode
        self.left = 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.left = int(self.np_random.integers(1, self.longest + 1))
        return self.observe(), {"left": self.left, "options": options}

    def observe(self):
        self.observation_space.seed(int(self.np_random.integers(2**31)))
        return self.observation_space.sample()

    def step(self, action):
        self.left -= 1
        info = {"left": self.left, "action": repr(action)}
        if self.left % 2:
            numbers = np.array([self.left, -self.left], dtype=np.int16)
            info["odd"] = {"half": self.left / 2, "numbers": numbers, "yes": True}
        ended = self.left == 0
        by_chance = bool(self.np_random.integers(2))
        reward = float(self.np_random.normal())
        return self.observe(), reward, ended and by_chance, ended and not by_chance, info

    def render(self):
        return np.full((2, 2, 3), self.left, dtype=np.uint8)


class KillsItself(Uneven):
    """Its process is gone in the second step."""

    def step(self, action):
        if self.left == 1:
            os._exit(3)
        self.left = 2
        return super().step(action)


class CannotSaySo(Uneven):
    """What it raises cannot be sent to another process."""

    def step(self, action):
        failure = RuntimeError("here")
        failure.lock = threading.Lock()
        raise failure


class SpoilsOneSubEnv(Uneven):
    """Fails in the sub-environment whose episodes are longest."""

    def step(self, action):
        if self.left == self.longest:
            raise ValueError("too long")
        return super().step(action)


class Insists(Uneven):
    """Takes members of its action space alone, and at times not even those."""

    def step(self, action):
        assert self.action_space.contains(action), "no action"
        assert self.left > 1, "too late"
        return super().step(action)


class Rogue(Counting):
    """Does something to its process, by name, where it is told to."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 30}  # noqa: RUF012

    def __init__(self, does="nothing", at="step", render_mode=None, **kwargs):
        super().__init__(**kwargs)
        self.does, self.at, self.render_mode = does, at, render_mode
        self.hoard = []
        self.act("constructor")

    def act(self, at):
        if at == self.at:
            getattr(self, self.does)()

    def reset(self, *, seed=None, options=None):
        self.act("reset")
        observation, info = super().reset(seed=seed, options=options)
        return observation, {**info, "pid": os.getpid()}

    def step(self, action):
        self.act("step")
        return super().step(action)

    def render(self):
        self.act("render")
        return np.zeros((2, 2, 3), np.uint8)

    def close(self):
        self.act("close")

    def nothing(self):
        pass

    def exits(self):
        os._exit(7)

    def interrupts(self):
        raise KeyboardInterrupt("by hand")

    def leaves(self):
        raise SystemExit(3)

    def ends_a_generator(self):
        raise GeneratorExit

    def is_killed(self):
        os.kill(os.getpid(), signal.SIGKILL)

    def crashes(self):
        ctypes.string_at(0)

    def closes_all_files(self):
        os.closerange(0, 4096)

    def ignores_sigterm(self):
        signal.signal(signal.SIGTERM, signal.SIG_IGN)

    def prints(self):
        print("hello" * 1000, flush=True)
        os.write(1, b"to the first descriptor\n")

    def forks_and_exits(self):
        if os.fork() == 0:
            time.sleep(3600)
        os._exit(8)

    def forks_a_stranger_and_exits(self):
        if os.fork() == 0:
            os.setsid()
            time.sleep(8)
            os._exit(0)
        os._exit(8)

    def hoards(self):
        self.hoard.append(np.ones(2**27))

    def never_returns(self):
        # Nor does any other thread of its process run meanwhile.
        ctypes.PyDLL(None).sleep(3600)

    def forges(self):
        for descriptor in range(3, 64):
            with contextlib.suppress(OSError):
                os.fstat(descriptor)
                if stat.S_ISSOCK(os.fstat(descriptor).st_mode):
                    os.write(descriptor, FORGED)


class Unpickled:
    """Creates the file that a test looks for, where it is unpickled."""

    def __reduce__(self):
        return open, (os.environ.get("FORGED_FILE", os.devnull), "w")


_FORGED = pickle.dumps(Unpickled())
# As a message of the server's own.
FORGED = len(_FORGED).to_bytes(8, "little") + _FORGED


class OwnSpace(spaces.Space):
    def __repr__(self):
        return "OwnSpace()"


class CustomSpace(Counting):
    action_space = OwnSpace()


class Deep(Counting):
    """Has a space in a space in a space."""

    def __init__(self, depth):
        super().__init__()
        self.observation_space = spaces.Discrete(2)
        for _ in range(depth):
            self.observation_space = spaces.Tuple([self.observation_space])

    def observe(self):
        return self.observation_space.sample()


class Variables(Counting):
    """Tells the variables of its process, as an environment might."""

    def __init__(self):
        raise ValueError(dict(os.environ))


class LongDouble(Counting):
    observation_space = spaces.Box(0, 1, (1,), np.longdouble)


def _bound(bound):
    return (
        np.array(bound) if isinstance(bound, list) else float(bound) if bound in _NAMED else bound
    )


_NAMED = ("inf", "-inf")

for _kind in (
    Counting,
    CannotSaySo,
    CustomSpace,
    Deep,
    Drawing,
    Echo,
    ExitsInStep,
    Hanging,
    HangsWhere,
    Insists,
    KillsItself,
    Letters,
    LongDouble,
    Meeting,
    Nested,
    NotANumber,
    OldRenderModes,
    RaisesInClose,
    RaisesInConstructor,
    RaisesInReset,
    RaisesInStep,
    ImportsInStep,
    Rogue,
    Shifted,
    Spins,
    SpoilsOneSubEnv,
    Uneven,
    Variables,
):
    gymnasium.register(id=f"{_kind.__name__}-v0", entry_point=_kind)
