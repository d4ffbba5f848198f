"""Record an environment's episodes: always a table, and videos on request."""

from __future__ import annotations

import csv
import logging
import time
from collections.abc import Callable

import gymnasium

from gym_server.envs.extras import how_to_install
from gym_server.envs.outcomes import reward_number
from gym_server.errors import GymServerError
from gym_server.monitoring.monitor_directory import TABLE, MonitorDirectory
from gym_server.monitoring.video import Video

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
        self._env = env
        self._directory = directory
        self._rows = csv.writer(directory.table, lineterminator="\n")
        self._video_every = video_every
        self._draw = draw
        self._video: Video | None = None
        self._episode: int | None = None
        self._episodes = 0
        self._failure: Exception | None = None

    def reset(self, *, seed: int | None, options: dict | None) -> tuple:
        """Reset the environment and start to record an episode."""
        self._finish_video()
        self._episode = None
        number = self._directory.next_episode
        result = self._env.reset(seed=seed, options=options)
        if self._video_every and number % self._video_every == 0:
            self._record(self._start_video, number)
        self._directory.next_episode = number + 1
        self._episode = number
        self._return = 0.0
        self._length = 0
        self._started = time.perf_counter()
        return result

    def step(self, action: object) -> tuple:
        """Take a step; write a row if the episode ends."""
        result: tuple = self._env.step(action)
        if self._video is not None:
            self._record(self._video.add)
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
            self._directory.release()
        except OSError as error:
            self._remember(error)
        if self._failure is not None:
            raise GymServerError(
                "monitor_directory",
                f"The recording in {self._directory.path} is incomplete: {self._failure}",
            ) from self._failure

    @property
    def pids(self) -> tuple[int, ...]:
        """The process that encodes the current video, if any."""
        video = self._video
        return (video.pid,) if video is not None else ()

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

    def _start_video(self, number: int, frame: object) -> None:
        self._directory.check()
        path = self._directory.path / f"rl-video-episode-{number}.mp4"
        self._video = Video(path, self._env.metadata.get("render_fps", 30), frame)
        self._video.add(frame)

    def _record(self, add: Callable[..., None], *args: object) -> None:
        frame = self._draw()
        # Not on the render thread, which others may need: encoding does not draw.
        try:
            add(*args, frame)
        except Exception as error:
            self._remember(error)
            self._finish_video()

    def _finish_video(self) -> None:
        video, self._video = self._video, None
        try:
            if video is not None:
                video.close()
        except Exception as error:
            self._remember(error)

    def _remember(self, error: Exception) -> None:
        # The step or reset itself succeeded and must be answered; close() raises the error.
        self._failure = self._failure or error
        log.error("A monitor in %s lost something", self._directory.path, exc_info=error)


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
