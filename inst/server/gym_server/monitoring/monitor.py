"""Record an environment's episodes: always a table, and videos on request."""

from __future__ import annotations

import csv
import logging
import time
from collections.abc import Callable

import gymnasium
import numpy as np
from gymnasium.wrappers import RecordVideo

from gym_server.envs.extras import how_to_install
from gym_server.envs.outcomes import reward_number
from gym_server.errors import GymServerError
from gym_server.monitoring.monitor_directory import TABLE, MonitorDirectory
from gym_server.rendering.png import picture

log = logging.getLogger(__name__)


class Monitor:
    """Records the episodes of one environment to a directory.

    The table gets a row when an episode ends: its number, the sum of its rewards, its steps, and
    its duration in seconds. Numbers count the resets since monitoring started, from 0. An episode
    that a reset cuts short leaves a gap. A video has the number of its episode.

    Only one thread at a time may call it.
    """

    def __init__(
        self,
        env: gymnasium.Env,
        directory: MonitorDirectory,
        video_every: int,
        draw: Callable[[], object],
    ) -> None:
        """Start to record the episodes that begin from now on.

        Args:
            env: the environment, which is recorded but never closed.
            directory: the result of ``take_directory()``.
            video_every: record a video of every episode whose number is a multiple; 0 for none. See
                ``require_video()``.
            draw: draws the environment.
        """
        self._directory = directory
        self._rows = csv.writer(directory.table, lineterminator="\n")
        self._videos: _Videos | None = None
        if video_every:
            drawn = _Drawn(env, draw, self._remember)
            self._videos = _Videos(drawn, directory, video_every, self._remember)
        self._env = self._videos or env
        self._episode: int | None = None
        self._episodes = 0
        self._failure: Exception | None = None

    def reset(self, *, seed: int | None, options: dict | None) -> tuple:
        """Reset the environment and start to record an episode."""
        self._episode = None
        result = self._env.reset(seed=seed, options=options)
        self._episode = self._directory.next_episode
        self._directory.next_episode += 1
        self._return = 0.0
        self._length = 0
        self._started = time.perf_counter()
        return result

    def step(self, action: object) -> tuple:
        """Take a step; write a row if the episode ends."""
        result: tuple = self._env.step(action)
        if self._episode is not None:
            _, reward, terminated, truncated, _ = result
            self._return += reward_number(reward)
            self._length += 1
            if terminated or truncated:
                self._finish_episode()
        return result

    def close(self) -> None:
        """Finish the files; the environment stays open.

        Raises:
            GymServerError: ``monitor_directory`` if something could not be written.
        """
        self._finish_video()
        try:
            self._directory.table.close()
        except OSError as error:
            self._remember(error)
        if self._failure is not None:
            raise GymServerError(
                "monitor_directory",
                f"The recording in {self._directory.path} is incomplete: {self._failure}",
            ) from self._failure

    def about(self) -> dict:
        """Return where the monitor writes, and how many episodes it has written."""
        return {
            "directory": str(self._directory.path),
            "table": TABLE,
            "episodes": self._episodes,
        }

    def _finish_episode(self) -> None:
        seconds = time.perf_counter() - self._started
        row = (self._episode, self._return, self._length, round(seconds, 6))
        self._episode = None
        try:
            self._rows.writerow(row)
            # So that readers see every finished episode, even after a crash.
            self._directory.table.flush()
            self._episodes += 1
        except OSError as error:
            self._remember(error)
        self._finish_video()

    def _finish_video(self) -> None:
        if self._videos is not None and self._videos.recording:
            self._videos.stop_recording()

    def _remember(self, error: Exception) -> None:
        # The step or reset itself succeeded and must be answered; close() raises the error.
        self._failure = self._failure or error
        log.error("A monitor in %s lost something", self._directory.path, exc_info=error)


class _Videos(RecordVideo):
    """Gymnasium's videos; one that cannot be written costs no step."""

    def __init__(
        self,
        env: gymnasium.Env,
        directory: MonitorDirectory,
        every: int,
        remember: Callable[[Exception], None],
    ) -> None:
        super().__init__(env, str(directory.path), lambda number: number % every == 0)
        self.episode_id = directory.next_episode - 1
        self._remember = remember

    def stop_recording(self) -> None:
        """Write the video."""
        try:
            super().stop_recording()  # type: ignore[no-untyped-call]
        except Exception as error:
            self._remember(error)
            self.recorded_frames, self.recording = [], False


class _Drawn(gymnasium.Wrapper):
    """Draws for ``RecordVideo``, which ends a video when it gets no picture."""

    def __init__(
        self,
        env: gymnasium.Env,
        draw: Callable[[], object],
        remember: Callable[[Exception], None],
    ) -> None:
        super().__init__(env)
        self._draw = draw
        self._remember = remember

    def render(self) -> np.ndarray | None:
        """Return a picture in RGB; None if there is none."""
        try:
            pixels = picture(self._draw())
        except Exception as error:
            self._remember(error)
            return None
        # Turns grey into RGB, and drops the last channel of RGBA.
        return np.broadcast_to(pixels[:, :, :3], (*pixels.shape[:2], 3))


def require_video(env: gymnasium.Env) -> None:
    """Raise ``video_unavailable`` if no videos of an environment can be made."""
    if env.render_mode != "rgb_array":
        raise GymServerError(
            "video_unavailable",
            "This environment draws no pictures, so there is nothing to record",
            "leave video_callable out, or create the environment with render_mode 'rgb_array'",
        )
    try:
        import moviepy  # noqa: F401
    except ImportError as error:
        raise GymServerError(
            "video_unavailable",
            f"Videos need moviepy, which this server does not have: {error}",
            f"{how_to_install('video')}, or leave video_callable out",
            "video",
        ) from error
