"""Check the rewards and infos that environments return."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gym_server.errors import GymServerError
from gym_server.json_values import brief


def reward_number(reward: Any) -> float:
    """Return a reward as a number; it may be an array with one element.

    Raises:
        GymServerError: ``environment_error``.
    """
    try:
        return float(reward.item() if isinstance(reward, np.ndarray) else reward)
    except (TypeError, ValueError):
        raise GymServerError(
            "environment_error",
            f"A reward must be a number, and the environment returned {brief(reward)}",
        ) from None


def checked_info(info: Any) -> Any:
    """Return an info after checking that it is a dict.

    Raises:
        GymServerError: ``environment_error``.
    """
    # A dict first: checking for other mappings takes longer.
    if isinstance(info, (dict, Mapping)):
        return info
    raise GymServerError(
        "environment_error",
        f"An info must be a dict, and the environment returned {brief(info)}",
        "return {} for an empty info",
    )
