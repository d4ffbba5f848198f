"""What to keep of the steps of episodes: all of them, or the moments of the observations."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Dict, Space, Tuple

from gym_server.errors import GymServerError
from gym_server.protocol.safetensors import Tensor
from gym_server.rollouts.task import MOST_BYTES, Keep
from gym_server.spaces import parts_of, stack, tensor_writer
from gym_server.spaces.stacking import ARRAYS

# The moments of observations with this many numbers together are computed at once, and then merged.
# Only the observation's size determines this, so that moments depend on nothing else.
_NUMBERS_AT_ONCE = 2**20

_NUMBERS = (int, float, np.number, np.bool_)


def check_keep(keep: Keep, observation_space: Space, action_space: Space) -> None:
    """Refuse to keep observations or actions that are not arrays.

    Raises:
        GymServerError: ``not_supported``.
    """
    if keep.moments and not isinstance(observation_space, ARRAYS):
        raise GymServerError("not_supported", "Only observations that are arrays have moments")
    if keep.steps and not (_has_arrays(observation_space) and _has_arrays(action_space)):
        raise GymServerError(
            "not_supported",
            "Steps are kept only if observations and actions are arrays, Tuples or Dicts of arrays",
            "reset and step an instance instead",
        )


def _has_arrays(space: Space) -> bool:
    if isinstance(space, (Tuple, Dict)):
        return len(space.spaces) > 0 and all(map(_has_arrays, parts_of(space)))
    return isinstance(space, ARRAYS)


def _bytes_of(space: Space) -> int:
    """Return the size of a value whose parts are arrays."""
    if isinstance(space, ARRAYS):
        return math.prod(space.shape or ()) * np.dtype(space.dtype).itemsize
    return sum(map(_bytes_of, parts_of(space)))


class Moments:
    """The count, the mean and the sums of squared deviations of an episode's observations."""

    def __init__(self, observation_space: Space) -> None:
        """Start with no observations."""
        size = int(np.prod(observation_space.shape or ()))
        self._at_once = max(1, _NUMBERS_AT_ONCE // max(1, size))
        self._waiting: list[np.ndarray] = []
        self._count = 0
        self._mean = np.zeros(size)
        self._squares = np.zeros(size)

    def add(self, observation: Any) -> None:
        """Add an observation."""
        self._waiting.append(np.array(observation, dtype=np.float64).reshape(-1))
        if len(self._waiting) == self._at_once:
            self._merge()

    def _merge(self) -> None:
        """Merge the waiting observations by the method of Chan, Golub and LeVeque (1979)."""
        if not self._waiting:
            return
        self.add_rows(np.stack(self._waiting))
        self._waiting = []

    def add_rows(self, values: np.ndarray) -> None:
        """Add the rows of a matrix, at most as many as are merged at once."""
        new = len(values)
        mean = values.mean(axis=0)
        deviations = values - mean
        squares = (deviations * deviations).sum(axis=0)
        before, self._count = self._count, self._count + new
        apart = mean - self._mean
        self._mean = self._mean + apart * (new / self._count)
        self._squares = self._squares + squares + apart * apart * (before * (new / self._count))

    def result(self) -> tuple[int, np.ndarray, np.ndarray]:
        """Return the count, the mean and the sums."""
        self._merge()
        return self._count, self._mean, self._squares


class Recorder:
    """Records the steps of single episodes, one after another."""

    def __init__(self, keep: Keep, observation_space: Space, action_space: Space) -> None:
        """Start with no episodes."""
        self._keep = keep
        self._observation_space = observation_space
        self._action_space = action_space
        self._copy_observation = _copier(observation_space)
        self._copy_action = _copier(action_space)
        self._moments: list[tuple[int, np.ndarray, np.ndarray]] = []
        self._of_episode: Moments | None = None
        self._observations: list = []
        self._actions: list = []
        self._next_observations: list = []
        self._rewards: list[float] = []
        self._flags: list[tuple[bool, bool]] = []
        self._complete = 0
        observations = 2 if keep.next_observation else 1
        size = observations * _bytes_of(observation_space) + _bytes_of(action_space)
        self._most_steps = int(MOST_BYTES // max(1, size))

    def begin(self) -> None:
        """Start an episode."""
        if self._keep.moments:
            self._of_episode = Moments(self._observation_space)

    def before(self, observation: Any, action: Any) -> None:
        """Record an observation and the action."""
        if self._of_episode is not None:
            self._of_episode.add(observation)
        if self._keep.steps:
            self._observations.append(self._copy_observation(observation))
            self._actions.append(self._copy_action(action))

    def after(self, observation: Any, reward: float, terminated: bool, truncated: bool) -> None:
        """Record the outcome of a step."""
        if self._keep.steps:
            self._rewards.append(reward)
            self._flags.append((bool(terminated), bool(truncated)))
            if self._keep.next_observation:
                self._next_observations.append(self._copy_observation(observation))
            if len(self._rewards) - self._complete > self._most_steps:
                raise GymServerError(
                    "too_much_memory",
                    f"The steps of an episode may take {MOST_BYTES // 2**20} MiB, which are "
                    f"{self._most_steps:,} of these, but this episode is longer",
                    "use a smaller max_steps",
                )

    def end(self) -> None:
        """End the episode."""
        if self._of_episode is not None:
            self._moments.append(self._of_episode.result())
        self._complete = len(self._rewards)

    def tensors(self) -> dict[str, Tensor]:
        """Return what was kept of the finished episodes."""
        tensors: dict[str, Tensor] = {}
        if self._keep.moments:
            tensors.update(moment_tensors(self._moments))
        if self._keep.steps:
            most = self._complete
            observed, acted = self._observation_space, self._action_space
            flags = np.array(self._flags[:most], dtype=bool).reshape(most, 2)
            steps = {
                "observation": stack(observed, self._observations[:most]),
                "action": stack(acted, self._actions[:most]),
            }
            if self._keep.next_observation:
                steps["next_observation"] = stack(observed, self._next_observations[:most])
            rewards = np.array(self._rewards[:most], dtype=np.float64)
            tensors.update(step_tensors(steps, observed, acted, rewards, flags[:, 0], flags[:, 1]))
        return tensors


def result_tensors(earned: Any, length: Any, terminated: Any, truncated: Any) -> dict[str, Tensor]:
    """Return the outcomes of episodes as tensors; see ``Played``."""
    return {
        "return": Tensor.of(np.array(earned, dtype=np.float64)),
        "length": Tensor.of(np.array(length, dtype=np.int32)),
        "terminated": Tensor.of(np.array(terminated, dtype=bool)),
        "truncated": Tensor.of(np.array(truncated, dtype=bool)),
    }


def moment_tensors(moments: list[tuple[int, np.ndarray, np.ndarray]]) -> dict[str, Tensor]:
    """Return the moments of episodes as tensors."""
    counts, means, squares = zip(*moments, strict=True) if moments else ((), (), ())
    return {
        "moments/count": Tensor.of(np.array(counts, dtype=np.float64)),
        "moments/mean": Tensor.of(np.array(means, dtype=np.float64)),
        "moments/squares": Tensor.of(np.array(squares, dtype=np.float64)),
    }


def step_tensors(
    steps: dict[str, Any],
    observation_space: Space,
    action_space: Space,
    reward: np.ndarray,
    terminated: np.ndarray,
    truncated: np.ndarray,
) -> dict[str, Tensor]:
    """Return steps, given as batches by name, as tensors with a row per step."""
    tensors: dict[str, Tensor] = {}
    for name, batch in steps.items():
        space = action_space if name == "action" else observation_space
        tensors.update(tensor_writer(space, name, is_batch=True)(batch, False).tensors)
    tensors["step/reward"] = Tensor.of(reward)
    tensors["step/terminated"] = Tensor.of(terminated)
    tensors["step/truncated"] = Tensor.of(truncated)
    return tensors


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


def _copier(space: Space) -> Callable[[Any], Any]:
    """Return a function that copies a value; the environment may change it in place later."""
    return _copy_number if isinstance(space, ARRAYS) else _copy_parts


def _copy_number(value: Any) -> Any:
    # A number never changes, and making an array of it takes longer than a step in a table.
    return value if isinstance(value, _NUMBERS) else np.array(value)


def _copy_parts(value: Any) -> Any:
    if type(value) is tuple and all(isinstance(part, _NUMBERS) for part in value):
        return value
    return copy.deepcopy(value)
