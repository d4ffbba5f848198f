"""Remember why the server removed instances, for clients that still use them."""

from __future__ import annotations

import threading

from gym_server.errors import GymServerError, unknown_instance


class Tombstones:
    """The reasons by instance_id; only the latest are kept."""

    def __init__(self, most: int = 10_000) -> None:
        """Set how many to keep."""
        self._most = most
        self._lock = threading.Lock()
        self._reasons: dict[str, GymServerError] = {}

    def add(self, instance_id: str, why: GymServerError) -> None:
        """Remember why an instance was removed."""
        with self._lock:
            # Store a copy: an exception that was raised refers to its stack, and so to the
            # environment.
            self._reasons[instance_id] = why.again()
            while len(self._reasons) > self._most:
                del self._reasons[next(iter(self._reasons))]

    def why(self, instance_id: str) -> GymServerError:
        """Return the error for an instance that was removed, or is unknown."""
        reason = self._reasons.get(instance_id)
        return unknown_instance(instance_id) if reason is None else reason.again()

    def __contains__(self, instance_id: str) -> bool:
        return instance_id in self._reasons
