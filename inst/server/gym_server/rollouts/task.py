"""What to play: an environment, a policy, and episodes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gym_server.envs.config import EnvConfig

# Larger results are cut after whole episodes. An episode whose steps exceed this is an error.
MOST_BYTES = 64 * 2**20


@dataclass(frozen=True)
class Keep:
    """What to keep of an episode besides its return, length and flags.

    Attributes:
        moments: the count of observations, their mean, and the sums of squared deviations.
        steps: each observation, action, reward, and both flags.
        next_observation: also the observation after each step.
    """

    moments: bool = False
    steps: bool = False
    next_observation: bool = False


class Unit(NamedTuple):
    """Episodes that are played together: a single one, or those of a group.

    Attributes:
        seed: the seed of the episode or the group.
        candidates: the candidate that plays each episode.
        rows: the place of each in its group; None for a single episode.
    """

    seed: int
    candidates: tuple[int, ...]
    rows: tuple[int, ...] | None = None


@dataclass(frozen=True)
class Task:
    """What all episodes of a request have in common, as it is sent to processes.

    Attributes:
        config: the environment.
        allowed_modules: the modules that an env_id may import.
        policy: the policy, as a JSON object.
        tensors: the policy's numbers by name.
        max_steps: after how many steps an episode is truncated; None for never.
        keep: what to keep.
    """

    config: EnvConfig
    allowed_modules: frozenset[str]
    policy: dict = field(default_factory=dict)
    tensors: Mapping[str, np.ndarray] = field(default_factory=dict)
    max_steps: int | None = None
    keep: Keep = field(default_factory=Keep)

    @cached_property
    def env_key(self) -> str:
        """Identifies the environment: tasks with the same key are played in the same one."""
        config = self.config
        return json.dumps([config.env_id, config.kwargs, config.wrappers], default=str)
