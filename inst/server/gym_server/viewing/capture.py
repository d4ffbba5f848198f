"""Capture what an environment shows between two resets or steps, with little delay.

A capture needs two things that others need, too: the environment's lock, which a step holds, and
the render thread, which draws, closes and sometimes steps other environments.
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

# A watcher that waits longer than this for a step gets the answer "busy".
_LOCK_TIMEOUT = 2.0


class Busy(Exception):  # noqa: N818
    """A step, or other drawing, takes too long to capture anything."""


class Capture(NamedTuple):
    """An environment at one moment.

    Attributes:
        resets_and_steps: how many of its resets and steps had started.
        facts: the JSON values of ``Watchable.look()``.
        frame: the picture, or None.
        began: when the capture started to block steps, in the clock's seconds.
        seconds: for how long it blocked them.
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
        watchable: the environment.
        sub_env: the sub-environment, from 0.
        deadline: until when to wait for the render thread, in the clock's seconds.
        may_wait_until: returns, given a deadline, whether to keep waiting.

    Raises:
        Busy: the lock or the render thread did not become free in time.
        GymServerError: ``unknown_instance``.
    """
    if not watchable.draws_on_render_thread:
        with _locked(watchable, may_wait_until) as began:
            return _look(watchable, sub_env, began)
    while True:
        # Take the render thread first and then the lock. A thread that held the lock and waited for
        # the render thread would block the environment's steps while others are drawn.
        try:
            captured = watchable.renderer.run_while(
                lambda: may_wait_until(deadline), _look_if_free, watchable, sub_env
            )
        except Occupied:
            raise Busy from None
        if captured is not None:
            return captured
        # A step holds the lock, and maybe steps follow without a pause. Then capture right after a
        # step. If the environment's steps hold the lock and wait for the render thread, it costs
        # nothing that a capture does so, too.
        may_wait: Callable[[], bool] = (
            (lambda: may_wait_until(deadline)) if watchable.draws_when_stepped else (lambda: False)
        )
        with _locked(watchable, may_wait_until) as began, contextlib.suppress(Occupied):
            return watchable.renderer.run_while(may_wait, _look, watchable, sub_env, began)


def _look_if_free(watchable: Watchable, sub_env: int) -> Capture | None:
    # Do not wait: the step that holds the lock may itself wait for the render thread.
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
    """Hold the lock, unless a step holds it for too long; yield the time it was taken."""
    deadline = time.monotonic() + _LOCK_TIMEOUT
    # Wait briefly each time, so that a step that hangs does not delay the end of the server.
    while not watchable.lock.acquire(0.1):
        if not may_wait_until(deadline):
            raise Busy
    try:
        yield time.monotonic()
    finally:
        watchable.lock.release()
