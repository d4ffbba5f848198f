"""What is to be played: an environment, a policy, and episodes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gym_server.envs.config import EnvConfig

# A larger answer is cut after whole episodes, and an episode whose steps take more is refused.
MOST_BYTES = 64 * 2**20


@dataclass(frozen=True)
class Keep:
    """What is kept of an episode beside its return, its length and its flags.

    Attributes:
        moments: how many observations there were, their mean, and the sums of squared deviations.
        steps: each observation, action, reward, and both flags.
        next_observation: also the observation after each step.
    """

    moments: bool = False
    steps: bool = False
    next_observation: bool = False


class Unit(NamedTuple):
    """Episodes that are played together: one, or as many as a group has.

    Attributes:
        seed: of the episode, or of the group.
        candidates: which candidate plays each episode.
        rows: the place of each in its group; None for a single episode.
    """

    seed: int
    candidates: tuple[int, ...]
    rows: tuple[int, ...] | None = None


@dataclass(frozen=True)
class Task:
    """What all episodes of a request have in common, as it goes to the processes.

    Attributes:
        config: the environment.
        allowed_modules: names of the modules that an env_id may import.
        memory: how many bytes an environment may be estimated to take.
        policy: the policy, as a JSON object.
        tensors: its numbers, by name.
        max_steps: after how many steps an episode is cut short; None for never.
        keep: what is kept.
    """

    config: EnvConfig
    allowed_modules: frozenset[str]
    memory: float
    policy: dict = field(default_factory=dict)
    tensors: Mapping[str, np.ndarray] = field(default_factory=dict)
    max_steps: int | None = None
    keep: Keep = field(default_factory=Keep)

    @cached_property
    def env_key(self) -> str:
        """Two tasks with the same key are played in the same environment."""
        config = self.config
        return json.dumps([config.env_id, config.kwargs, config.wrappers], default=str)
