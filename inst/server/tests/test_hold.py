"""The right to an environment."""

import threading
from types import SimpleNamespace

import pytest

from gym_server.errors import GymServerError
from gym_server.hold import Hold


@pytest.fixture
def hold():
    return Hold(SimpleNamespace(instance_id="12345678"))


def test_one_has_it_at_a_time(hold):
    with hold:
        assert not hold.take(0)
    assert hold.take(0)
    assert not hold.take(0)
    hold.give_back()


def test_to_move_is_a_use_and_to_look_is_none(hold):
    hold.used = 0.0
    assert hold.take(0)
    hold.give_back()
    assert hold.used == 0.0
    with hold:
        assert hold.used > 0.0


def test_nobody_has_it_once_the_environment_is_closed(hold):
    waiting = threading.Thread(target=lambda: refused(hold.__enter__))
    with hold:
        waiting.start()
        hold.closed = True
    waiting.join(5)
    assert not waiting.is_alive()
    for _ in range(2):
        refused(hold.take, 0)


def refused(call, *args):
    with pytest.raises(GymServerError, match="Instance_id 12345678 unknown"):
        call(*args)
