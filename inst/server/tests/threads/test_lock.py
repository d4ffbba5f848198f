"""The lock of an instance."""

import threading

import pytest

from gym_server.errors import GymServerError, unknown_instance
from gym_server.threads import calls
from gym_server.threads.lock import InstanceLock


@pytest.fixture
def lock():
    return InstanceLock(lambda: unknown_instance("12345678"), lambda call: f"{call}() of it")


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


def test_it_tells_what_it_is_held_for(lock):
    with lock:
        lock.call = "step"
        assert calls.overdue(-1) == "step() of it"
        assert lock.is_held
    assert lock.acquire(0)
    assert calls.overdue(-1) == "render() of it"
    lock.release()
    assert calls.overdue(-1) is None
    assert not lock.is_held
