"""Encode the video of an episode while it is played."""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gym_server.rendering.png import picture


class Video:
    """Writes frames to a file as they come, without keeping them.

    Attributes:
        pid: the process that encodes them.
    """

    def __init__(self, path: Path, fps: float, frame: object) -> None:
        """Start the encoder; ``add()`` must also be called for the first frame.

        Args:
            path: the file, an mp4.
            fps: frames per second.
            frame: the first frame; all frames must have its size.

        Raises:
            ValueError: the frame is not a picture.
        """
        # Importing it takes a second.
        from moviepy.video.io.ffmpeg_writer import FFMPEG_VideoWriter

        height, width, _ = self._shape = picture(frame).shape
        self._name = path.name
        # By default x264 keeps 40 frames to look ahead.
        ahead = ["-x264-params", "rc-lookahead=10"]
        with _signals_held():
            self._writer = FFMPEG_VideoWriter(str(path), (width, height), fps, ffmpeg_params=ahead)
        self._process = self._writer.proc
        self.pid: int = self._process.pid

    def add(self, frame: object) -> None:
        """Encode a frame.

        Raises:
            ValueError: the frame is not a picture, or has another size.
            OSError: it cannot be written.
        """
        pixels = picture(frame)
        if pixels.shape != self._shape:
            raise ValueError(f"a frame of shape {pixels.shape} follows one of {self._shape}")
        # Turns grey into RGB, and drops the last channel of RGBA.
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
    """Protect a process that is started meanwhile from signals to the whole server.

    Ctrl-C and systemd signal all processes, but the server finishes its videos when it stops.
    """
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
