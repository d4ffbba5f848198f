"""Another client of a server under attack: how long its responses take."""

from __future__ import annotations

import contextlib
import http.client
import statistics
import threading
import time
from collections.abc import Iterator

from serving import Client

_PAUSE_SECONDS = 0.02
_TIMEOUT_SECONDS = 10.0


class Bystander:
    """Steps on a kept connection, and sends requests on new ones, until ``stop()``."""

    def __init__(self, port: int, token: str | None = None) -> None:
        """Make an environment and start to play.

        Args:
            port: the server's port.
            token: the server's token.
        """
        self._new = lambda: Client(port, _TIMEOUT_SECONDS, token)
        self._player = self._new()
        created = self._player.post("/v1/envs/", env_id="CartPole-v1")
        self._url = f"/v1/envs/{created['instance_id']}"
        self._player.post(f"{self._url}/reset/", seed=1)
        self._seconds: dict[str, list[float]] = {"steps": [], "new connections": []}
        self._failed = 0
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._stopped.wait(_PAUSE_SECONDS):
            with self._timed("steps"):
                self._step()
            with self._timed("new connections"):
                visitor = self._new()
                visitor.get("/v1/health/")
                visitor.close()

    @contextlib.contextmanager
    def _timed(self, what: str) -> Iterator[None]:
        began = time.monotonic()
        try:
            yield
        except (OSError, http.client.HTTPException):
            self._failed += 1
            self._player.close()
        self._seconds[what].append(time.monotonic() - began)

    def _step(self) -> None:
        if self._player.post(f"{self._url}/step/", action=1)["done"]:
            self._player.post(f"{self._url}/reset/")

    def figures(self) -> tuple[str, float, int]:
        """Return the measurements since the last call.

        Returns:
            The figures in words, the slowest response in seconds, and the number of missing ones.
        """
        seconds, self._seconds = self._seconds, {name: [] for name in self._seconds}
        failed, self._failed = self._failed, 0
        words = ", ".join(
            f"{name} {statistics.median(of) * 1000:.1f} (worst {max(of) * 1000:.0f}) ms"
            for name, of in seconds.items()
            if of
        )
        return (
            f"{words}, {failed} failed",
            max(max(of, default=0) for of in seconds.values()),
            failed,
        )

    def stop(self) -> None:
        """Stop playing."""
        self._stopped.set()
        self._thread.join()
        self._player.close()
