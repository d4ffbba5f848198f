"""Remember what was found for an observation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def remembered(find: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a function that finds the same, and looks up what it has found before.

    It is for observations that can be counted: it forgets nothing. Those that are arrays are
    found anew each time.
    """
    known: dict[Any, Any] = {}

    def look_up(observation: Any) -> Any:
        try:
            return known[observation]
        except KeyError:
            found = known[observation] = find(observation)
            return found
        except TypeError:
            return find(observation)

    return look_up
