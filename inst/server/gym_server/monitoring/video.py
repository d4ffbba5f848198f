"""The video of one episode, encoded while the episode is played."""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gym_server.rendering.png import picture


class Video:
    """Writes frames to a file as they come, and keeps none.

    Attributes:
        pid: of the process that encodes them.
    """

    def __init__(self, path: Path, fps: float, frame: object) -> None:
        """Start the encoder; ``add()`` also the first frame.

        Args:
            path: of the file, an mp4.
            fps: frames a second.
            frame: the first frame; all others must be of its size.

        Raises:
            ValueError: it is no picture.
        """
        # It takes a second to import.
        from moviepy.video.io.ffmpeg_writer import FFMPEG_VideoWriter

        height, width, _ = self._shape = picture(frame).shape
        self._name = path.name
        # x264 looks 40 frames ahead by default, and keeps them meanwhile.
        ahead = ["-x264-params", "rc-lookahead=10"]
        with _signals_held():
            self._writer = FFMPEG_VideoWriter(str(path), (width, height), fps, ffmpeg_params=ahead)
        self._process = self._writer.proc
        self.pid: int = self._process.pid

    def add(self, frame: object) -> None:
        """Encode one more frame.

        Raises:
            ValueError: it is no picture, or one of another size.
            OSError: it cannot be written.
        """
        pixels = picture(frame)
        if pixels.shape != self._shape:
            raise ValueError(f"a frame of shape {pixels.shape} follows one of {self._shape}")
        # Grey becomes RGB, and RGBA loses its last channel.
        self._writer.write_frame(np.broadcast_to(pixels[:, :, :3], (*pixels.shape[:2], 3)))

    def close(self) -> None:
        """Finish the file.

        Raises:
            OSError: it is incomplete.
        """
        self._writer.close()
        if self._process.returncode != 0:
            status = self._process.returncode
            raise OSError(f"the encoder of {self._name} ended with status {status}")


@contextlib.contextmanager
def _signals_held() -> Iterator[None]:
    """Let a process that is started meanwhile live on when all of the server's are asked to stop.

    Ctrl-C and systemd reach it as well, and the server finishes its video when it stops.
    """
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
