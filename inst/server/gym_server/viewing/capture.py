"""A look at an environment between two of its moves, which keeps it from none for long.

It takes two things that others have, too: the right to the environment, which a step has, and
the render thread, where other environments are drawn, closed and, some of them, stepped.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

from gym_server.rendering.render_thread import Occupied

if TYPE_CHECKING:
    import numpy as np

    from gym_server.instances.instance import Instance

# How long a step may keep a watcher waiting before it hears of that.
_PATIENCE = 2.0


class Busy(Exception):  # noqa: N818
    """A step, or what others draw, takes so long that nothing can be seen."""


class Glimpse(NamedTuple):
    """An environment at one moment.

    Attributes:
        moves: how often it had moved.
        facts: what ``Instance.look()`` tells.
        frame: the picture, or None.
        began: since when it could not move, in the clock's seconds.
        held: for how many seconds.
    """

    moves: int
    facts: dict
    frame: np.ndarray | None
    began: float
    held: float


def glimpse(
    instance: Instance, sub_env: int, deadline: float, is_patient: Callable[[float], bool]
) -> Glimpse:
    """Look at a sub-environment of an instance.

    Args:
        instance: what to look at.
        sub_env: its number, from 0.
        deadline: until when to wait for the render thread, in the clock's seconds.
        is_patient: tells, given such a deadline, whether to wait on.

    Raises:
        Busy: there is nothing to be seen.
        GymServerError: ``unknown_instance``.
    """
    if not instance.draws_on_render_thread():
        with _holding(instance, is_patient) as began:
            return _look(instance, sub_env, began)
    while True:
        # First the render thread: who has the hold and then waits for it keeps the environment
        # from its steps while others are drawn.
        try:
            seen = instance.renderer.run_while(
                lambda: is_patient(deadline), _look_if_free, instance, sub_env
            )
        except Occupied:
            raise Busy from None
        if seen is not None:
            return seen
        # It is being stepped, maybe all the time: then no moment is better than right after a
        # step. If its steps wait for the render thread themselves, this may wait there as they do.
        goes_on = (lambda: is_patient(deadline)) if instance.draws_when_stepped else (lambda: False)
        with _holding(instance, is_patient) as began, contextlib.suppress(Occupied):
            return instance.renderer.run_while(goes_on, _look, instance, sub_env, began)


def _look_if_free(instance: Instance, sub_env: int) -> Glimpse | None:
    # No waiting here: the step that has the hold may wait for the render thread.
    if not instance.hold.take(0):
        return None
    try:
        return _look(instance, sub_env, time.monotonic())
    finally:
        instance.hold.give_back()


def _look(instance: Instance, sub_env: int, began: float) -> Glimpse:
    moves = instance.moves
    facts, frame = instance.look(sub_env)
    return Glimpse(moves, facts, frame, began, time.monotonic() - began)


@contextlib.contextmanager
def _holding(instance: Instance, is_patient: Callable[[float], bool]) -> Iterator[float]:
    """Have the hold, unless a step has it for too long; give the time when it was taken."""
    deadline = time.monotonic() + _PATIENCE
    # In short waits: a step that hangs must not keep the server from its end.
    while not instance.hold.take(0.1):
        if not is_patient(deadline):
            raise Busy
    try:
        yield time.monotonic()
    finally:
        instance.hold.give_back()
