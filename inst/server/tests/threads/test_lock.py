"""The lock of an instance."""

import threading
import time

import pytest

from gym_server.errors import GymServerError, unknown_instance
from gym_server.rendering.render_thread import RenderThread
from gym_server.threads.lock import InstanceLock


@pytest.fixture
def cleared():
    """Return what the lock has closed so far."""
    return []


@pytest.fixture
def lock(cleared):
    return InstanceLock(lambda: unknown_instance("12345678"), lambda: cleared.append(True))


def test_one_has_it_at_a_time(lock):
    with lock:
        assert not lock.acquire(0)
    assert lock.acquire(0)
    assert not lock.acquire(0)
    lock.release()


def test_to_move_is_a_use_and_to_look_is_none(lock):
    lock.used = 0.0
    assert lock.acquire(0)
    lock.release()
    assert lock.used == 0.0
    with lock:
        assert lock.used > 0.0


def test_nobody_has_it_once_the_environment_is_closed(lock):
    waiting = threading.Thread(target=lambda: refused(lock.__enter__))
    with lock:
        waiting.start()
        lock.closed = True
    waiting.join(5)
    assert not waiting.is_alive()
    for _ in range(2):
        refused(lock.acquire, 0)


def refused(call, *args):
    with pytest.raises(GymServerError, match="Instance_id 12345678 unknown"):
        call(*args)


def test_it_tells_since_when_it_is_taken(lock):
    assert lock.busy_since is None
    before = time.monotonic()
    with lock:
        assert before <= lock.busy_since <= time.monotonic()
    assert lock.busy_since is None
    assert lock.acquire(0)
    assert lock.busy_since is not None
    lock.release()
    assert lock.busy_since is None


def test_who_waits_for_the_render_thread_has_not_begun(eventually):
    renderer = RenderThread()
    lock = InstanceLock(lambda: unknown_instance("12345678"), lambda: None, renderer.began)
    occupied, may_end = threading.Event(), threading.Event()

    def occupy():
        occupied.set()
        may_end.wait(10)

    occupying = threading.Thread(target=renderer.run, args=(occupy,))
    occupying.start()
    assert occupied.wait(10)

    def draw():
        with lock:
            renderer.run(lambda: None)

    drawing = threading.Thread(target=draw)
    drawing.start()
    eventually(lambda: lock.busy_since is not None)
    since = lock.busy_since
    eventually(lambda: lock.busy_since > since)
    may_end.set()
    drawing.join(10)
    occupying.join(10)
    assert lock.busy_since is None
    renderer.stop()


def test_it_can_be_taken_away_from_a_thread_that_is_stuck(lock, cleared):
    why = GymServerError("call_too_long", "too long")
    entered, may_end = threading.Event(), threading.Event()
    outcomes = []

    def have(do):
        try:
            with lock:
                do()
        except GymServerError as refusal:
            outcomes.append(refusal.message)

    stuck = threading.Thread(target=have, args=(lambda: (entered.set(), may_end.wait(10)),))
    stuck.start()
    assert entered.wait(10)
    queued = threading.Thread(target=have, args=(lambda: outcomes.append("entered"),))
    queued.start()
    assert lock.abandon(why) == stuck.ident
    queued.join(10)
    assert outcomes == ["too long"]
    assert cleared == []
    with pytest.raises(GymServerError, match="too long"):
        lock.acquire(0)
    may_end.set()
    # Otherwise its next request might get the answer that is still being sent for this one.
    stuck.join(0.2)
    assert stuck.is_alive()
    lock.answered()
    stuck.join(10)
    assert outcomes == ["too long", "too long"]
    assert cleared == [True]
    assert lock.abandon(why) is None
