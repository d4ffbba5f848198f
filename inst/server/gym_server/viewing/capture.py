"""Capture what an environment shows between two resets or steps, without delaying it for long.

A capture needs two things that others need, too: the environment's lock, which a step takes, and
the render thread, where other environments are drawn, closed and, some of them, stepped.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

from gym_server.rendering.render_thread import Occupied
from gym_server.viewing.watchable import Watchable

if TYPE_CHECKING:
    import numpy as np

# How long a step may keep a watcher waiting before the watcher gets the answer "busy".
_LOCK_TIMEOUT = 2.0


class Busy(Exception):  # noqa: N818
    """A step, or other drawing, takes so long that nothing can be captured."""


class Capture(NamedTuple):
    """An environment at one moment.

    Attributes:
        resets_and_steps: how many of it had begun.
        facts: the JSON values of ``Watchable.look()``.
        frame: the picture, or None.
        began: since when it could not be stepped, in the clock's seconds.
        seconds: for how long it could not.
    """

    resets_and_steps: int
    facts: dict
    frame: np.ndarray | None
    began: float
    seconds: float


def capture(
    watchable: Watchable, sub_env: int, deadline: float, may_wait_until: Callable[[float], bool]
) -> Capture:
    """Capture a sub-environment.

    Args:
        watchable: what to look at.
        sub_env: its number, from 0.
        deadline: until when to wait for the render thread, in the clock's seconds.
        may_wait_until: tells, given a deadline, whether to wait on.

    Raises:
        Busy: the lock or the render thread did not become free in time.
        GymServerError: ``unknown_instance``.
    """
    if not watchable.draws_on_render_thread:
        with _locked(watchable, may_wait_until) as began:
            return _look(watchable, sub_env, began)
    while True:
        # First the render thread, then the lock: a thread that had the lock and then waited for
        # the render thread would keep the environment from its steps while others are drawn.
        try:
            captured = watchable.renderer.run_while(
                lambda: may_wait_until(deadline), _look_if_free, watchable, sub_env
            )
        except Occupied:
            raise Busy from None
        if captured is not None:
            return captured
        # It is being stepped, maybe all the time; then no moment is better than right after a
        # step. Environments whose steps wait for the render thread with the lock lose nothing
        # when a capture does so as well.
        may_wait: Callable[[], bool] = (
            (lambda: may_wait_until(deadline)) if watchable.draws_when_stepped else (lambda: False)
        )
        with _locked(watchable, may_wait_until) as began, contextlib.suppress(Occupied):
            return watchable.renderer.run_while(may_wait, _look, watchable, sub_env, began)


def _look_if_free(watchable: Watchable, sub_env: int) -> Capture | None:
    # Without waiting: the step that has the lock may itself wait for the render thread.
    if not watchable.lock.acquire(0):
        return None
    try:
        return _look(watchable, sub_env, time.monotonic())
    finally:
        watchable.lock.release()


def _look(watchable: Watchable, sub_env: int, began: float) -> Capture:
    begun = watchable.resets_and_steps
    facts, frame = watchable.look(sub_env)
    return Capture(begun, facts, frame, began, time.monotonic() - began)


@contextlib.contextmanager
def _locked(watchable: Watchable, may_wait_until: Callable[[float], bool]) -> Iterator[float]:
    """Have the lock, unless a step has it for too long; yield the time when it was taken."""
    deadline = time.monotonic() + _LOCK_TIMEOUT
    # In short waits: a step that hangs must not delay the end of the server.
    while not watchable.lock.acquire(0.1):
        if not may_wait_until(deadline):
            raise Busy
    try:
        yield time.monotonic()
    finally:
        watchable.lock.release()
