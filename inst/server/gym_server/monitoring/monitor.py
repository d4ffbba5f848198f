"""Record an environment's episodes: a table always, videos where they are asked for."""

from __future__ import annotations

import csv
import logging
import time
from typing import Any

import gymnasium

from gym_server.envs.outcomes import reward_number
from gym_server.errors import GymServerError
from gym_server.monitoring.monitor_directory import MonitorRoot
from gym_server.monitoring.monitor_files import MonitorFiles, refuse
from gym_server.rendering.render_thread import RenderThread

log = logging.getLogger(__name__)

COLUMNS = ("episode", "return", "length", "seconds")


class Monitor:
    """Records the episodes of one environment into a directory.

    The table gets a row when an episode is done: its number, the sum of its rewards, its steps
    and its duration in seconds.  Numbers count the resets since the start of monitoring,
    from 0, so an episode that a reset cuts short leaves a gap, and a video has the number of its
    episode.

    The caller makes only one call at a time.
    """

    def __init__(
        self,
        env: gymnasium.Env,
        files: MonitorFiles,
        recorder: Any,
        renderer: RenderThread,
    ) -> None:
        """Take over files after their ``take()``, and a RecordVideo or None; see ``start()``."""
        self._env = env
        self._files = files
        self._rows = csv.writer(files.table, lineterminator="\n")
        self._recorder = recorder
        self._renderer = renderer
        self._episode: int | None = None
        self._episodes = 0
        self._failure: Exception | None = None

    @classmethod
    def start(
        cls,
        env: gymnasium.Env,
        root: MonitorRoot,
        directory: str,
        instance_id: str,
        force: bool,
        resume: bool,
        video_every: int,
        renderer: RenderThread,
    ) -> Monitor:
        """Start to record the episodes that begin from now on.

        Args:
            env: the environment; it is recorded, never closed.
            root: where monitors may write.
            directory: where this one writes, created when it is missing.
            instance_id: the environment's; see ``MonitorRoot.claim()``, also for the next two.
            force: first delete what monitors left there that are gone.
            resume: go on counting where the earlier monitor ended.
            video_every: record a video of each episode whose number this divides; 0 for none.
            renderer: the thread that draws.

        Raises:
            GymServerError: ``video_unavailable`` or ``monitor_directory``; nothing is changed.
        """
        if video_every:
            _require_video(env)
        files = root.claim(directory, instance_id, force, resume)
        try:
            recorder = _recorder(env, files, video_every) if video_every else None
            files.begin(COLUMNS)
        except OSError as error:
            files.leave()
            raise refuse(directory, error.strerror or str(error)) from error
        except BaseException:
            files.leave()
            raise
        return cls(env, files, recorder, renderer)

    def reset(self, *, seed: int | None, options: dict | None) -> tuple:
        """Reset the environment and start to record an episode."""
        self._finish_video()
        self._episode = None
        number = self._files.next_episode
        if self._recorder is None:
            result = self._env.reset(seed=seed, options=options)
        else:
            result = self._reset_recorder(number, seed, options)
        self._files.next_episode = number + 1
        self._episode = number
        self._return = 0.0
        self._length = 0
        self._started = time.perf_counter()
        return result

    def step(self, action: object) -> tuple:
        """Take a step; write the episode's row when it is done."""
        result: tuple
        if self._recorder is not None and self._recorder.recording:
            result = self._renderer.run(self._recorder.step, action)
        else:
            result = self._env.step(action)
        if self._episode is not None:
            _, reward, terminated, truncated, _ = result
            self._return += reward_number(reward)
            self._length += 1
            if terminated or truncated:
                self._finish_episode()
        return result

    def close(self) -> None:
        """Finish the files; the environment goes on.

        Raises:
            GymServerError: ``monitor_directory`` when something could not be written.
        """
        self._finish_video()
        try:
            self._files.release()
        except OSError as error:
            self._remember(error)
        if self._failure is not None:
            raise GymServerError(
                "monitor_directory",
                f"What was recorded in {self._files.path} is incomplete: {self._failure}",
            ) from self._failure

    def about(self) -> dict:
        """Return where the monitor writes, and how many episodes it has written."""
        return {
            "directory": str(self._files.path),
            "table": self._files.table_name,
            "episodes": self._episodes,
        }

    def _finish_episode(self) -> None:
        seconds = time.perf_counter() - self._started
        row = (self._episode, self._return, self._length, round(seconds, 6))
        self._episode = None
        try:
            self._rows.writerow(row)
            # So that the file has every episode that is done, for readers and after a crash.
            self._files.table.flush()
            self._episodes += 1
        except OSError as error:
            self._remember(error)
        self._finish_video()

    def _reset_recorder(self, number: int, seed: int | None, options: dict | None) -> tuple:
        recorder = self._recorder
        # RecordVideo has a count of its own; it must agree with the table's, also after a reset
        # that failed and after resuming.
        recorder.episode_id = number - 1
        if recorder.episode_trigger(number):
            try:
                self._files.add(self._files.video_name(number))
            except OSError as error:
                self._remember(error)
        return self._renderer.run(lambda: recorder.reset(seed=seed, options=options))

    def _finish_video(self) -> None:
        if self._recorder is None or not self._recorder.recording:
            return
        try:
            # Not on the render thread: encoding draws nothing, and others may need the thread.
            self._recorder.stop_recording()
        except Exception as error:
            self._remember(error)
            self._recorder.recording = False
            self._recorder.recorded_frames = []

    def _remember(self, error: Exception) -> None:
        # The step or reset that ends an episode was taken and must be answered; close() raises.
        self._failure = self._failure or error
        log.error("A monitor in %s lost something", self._files.path, exc_info=error)


def _require_video(env: gymnasium.Env) -> None:
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
            "install gym-server[video], or leave video_callable out",
            "video",
        ) from error


def _recorder(
    env: gymnasium.Env, files: MonitorFiles, video_every: int
) -> gymnasium.wrappers.RecordVideo:
    recorder = gymnasium.wrappers.RecordVideo(
        env,
        str(files.path),
        episode_trigger=lambda number: number % video_every == 0,
        name_prefix=files.video_prefix,
    )
    # A garbage collection after each video would stop every other environment.  (Not an
    # argument in Gymnasium 1.0.)
    recorder.gc_trigger = None
    return recorder
