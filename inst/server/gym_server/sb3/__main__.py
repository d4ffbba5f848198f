"""Run one job, ``python -m gym_server.sb3 job.json``."""

from __future__ import annotations

import faulthandler
import json
import os
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any


def _await_end_of_input(stopping: threading.Event) -> None:
    # R holds the other end: it closes it to end the job, and so does the system if R is killed.
    # Unlike sys.stdin, os.read() holds no lock that Python would wait for at its own end.
    while os.read(0, 1024):
        pass
    stopping.set()


def main(path: Path) -> None:
    """Run the job of a file, and write ``result.json`` beside it."""
    faulthandler.enable()
    stopping = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stopping.set())
    threading.Thread(target=_await_end_of_input, args=[stopping], daemon=True).start()
    # PyTorch takes seconds to import; an end that comes meanwhile is not lost.
    from gym_server.sb3 import convert, files, play, train
    from gym_server.sb3.failures import in_words

    job: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    tasks: dict[str, Callable[..., dict[str, Any]]] = {
        "train": train.train,
        "convert": convert.convert,
        "play": play.play,
        "act": play.act,
    }
    try:
        result = tasks[job["task"]](job, path.parent, stopping)
    except Exception as failure:
        result = {"error": in_words(failure)}
    files.write_json(path.parent / "result.json", result)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
