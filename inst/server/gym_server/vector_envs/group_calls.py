"""Groups of sub-environments, in this process or in workers, and calls to several at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from gym_server.envs.drawing import Drawing
from gym_server.processes.worker_process import WorkerProcess
from gym_server.vector_envs.group import Group


class LocalGroup:
    """Has those methods of ``WorkerProcess`` that are used to call a group."""

    def __init__(self, group: Group, drawing: Drawing) -> None:
        """Take over a group, and the object that draws it."""
        self._group = group
        self._drawing = drawing
        self._call: Callable[[], Any] = lambda: None

    def begin(self, method: str, *args: object) -> None:
        """Prepare a call of one of the group's methods."""
        self._call = lambda: getattr(self._group, method)(*args)
        if method == "render":
            self._call = lambda: self._drawing.draw(self._group.render, *args)

    def finish(self) -> Any:
        """Make the call, and return its result."""
        return self._call()

    def close(self) -> None:
        """Close the group."""
        self._drawing.close(self._group.close)


AnyGroup = LocalGroup | WorkerProcess


def call_all(calls: Iterable[tuple[AnyGroup, str, tuple]]) -> list:
    """Start all calls and wait for all results; then raise the first error.

    Args:
        calls: a group, the name of one of its methods, and the arguments.
    """
    results = []
    begun = []
    failure: BaseException | None = None
    try:
        for group, method, arguments in calls:
            group.begin(method, *arguments)
            begun.append(group)
    except BaseException as refusal:
        failure = refusal
    for group in begun:
        # Take all results: one that is left over would be taken for the next call's.
        try:
            results.append(group.finish())
        except BaseException as refusal:
            failure = failure or refusal
    if failure is not None:
        raise failure
    return results
