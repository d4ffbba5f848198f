"""Keys to watch pages: a link has one instead of the server's token."""

from __future__ import annotations

import hashlib
import secrets
import threading
import time
from collections.abc import Callable

# How long a key is valid after it was made or last used.
KEY_SECONDS = 600

_MOST_KEYS = 10_000

# The environment variable with what all keys of this server begin with. By it the front of a group
# of servers (--users) knows whose page a key opens.
PREFIX_VARIABLE = "GYM_SERVER_WATCH_PREFIX"


class WatchKeys:
    """The valid keys, each for one environment's page."""

    def __init__(self, clock: Callable[[], float] = time.monotonic, prefix: str = "") -> None:
        """Start without keys.

        Args:
            clock: the time in seconds.
            prefix: what all keys begin with.
        """
        self._prefix = prefix
        self._clock = clock
        self._lock = threading.Lock()
        # By digest, so that keys can neither be read here nor guessed from the time of a
        # comparison. The key that expires next is first.
        self._keys: dict[bytes, tuple[str, float]] = {}

    def make(self, instance_id: str) -> str:
        """Make a new key to an instance's page."""
        key = self._prefix + secrets.token_urlsafe(24)
        with self._lock:
            self._drop_old()
            self._keys[_digest(key)] = (instance_id, self._clock() + KEY_SECONDS)
            if len(self._keys) > _MOST_KEYS:
                del self._keys[next(iter(self._keys))]
        return key

    def opens(self, key: str, instance_id: str) -> bool:
        """Return whether a key is valid for an instance's page, and renew it."""
        digest = _digest(key)
        with self._lock:
            self._drop_old()
            if self._keys.get(digest, ("", 0.0))[0] != instance_id:
                return False
            del self._keys[digest]
            self._keys[digest] = (instance_id, self._clock() + KEY_SECONDS)
        return True

    def _drop_old(self) -> None:
        now = self._clock()
        while self._keys:
            digest, (_, end) = next(iter(self._keys.items()))
            if end > now:
                return
            del self._keys[digest]


def _digest(key: str) -> bytes:
    return hashlib.sha256(key.encode("utf-8", "surrogatepass")).digest()
