"""The right to an environment."""

import threading
import time
from types import SimpleNamespace

import pytest

from gym_server.errors import GymServerError
from gym_server.instances.lock import Hold
from gym_server.rendering.render_thread import RenderThread


@pytest.fixture
def hold():
    cleared = []
    instance = SimpleNamespace(
        instance_id="12345678", cleared=cleared, clear_away=lambda: cleared.append(True)
    )
    return Hold(instance)


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


def test_it_tells_since_when_it_is_taken(hold):
    assert hold.busy_since is None
    before = time.monotonic()
    with hold:
        assert before <= hold.busy_since <= time.monotonic()
    assert hold.busy_since is None
    assert hold.take(0)
    assert hold.busy_since is not None
    hold.give_back()
    assert hold.busy_since is None


def test_who_waits_for_the_render_thread_has_not_begun():
    renderer = RenderThread()
    hold, may_end = Hold(SimpleNamespace(instance_id="12345678"), renderer), threading.Event()
    occupying = threading.Thread(target=renderer.run, args=(may_end.wait, 10))
    occupying.start()

    def draw():
        with hold:
            renderer.run(lambda: None)

    drawing = threading.Thread(target=draw)
    drawing.start()
    while hold.busy_since is None:
        time.sleep(0.01)
    since = hold.busy_since
    time.sleep(0.05)
    assert hold.busy_since > since
    may_end.set()
    drawing.join(10)
    occupying.join(10)
    assert hold.busy_since is None
    renderer.stop()


def test_it_can_be_taken_away_from_a_thread_that_is_stuck(hold):
    why = GymServerError("call_too_long", "too long")
    entered, may_end = threading.Event(), threading.Event()
    outcomes = []

    def have(do):
        try:
            with hold:
                do()
        except GymServerError as refusal:
            outcomes.append(refusal.message)

    stuck = threading.Thread(target=have, args=(lambda: (entered.set(), may_end.wait(10)),))
    stuck.start()
    assert entered.wait(10)
    queued = threading.Thread(target=have, args=(lambda: outcomes.append("entered"),))
    queued.start()
    assert hold.condemn(why) == stuck.ident
    queued.join(10)
    assert outcomes == ["too long"]
    assert hold._instance.cleared == []
    with pytest.raises(GymServerError, match="too long"):
        hold.take(0)
    may_end.set()
    # Its next request might get the answer that is still on its way for this one.
    stuck.join(0.2)
    assert stuck.is_alive()
    hold.settle()
    stuck.join(10)
    assert outcomes == ["too long", "too long"]
    assert hold._instance.cleared == [True]
    assert hold.condemn(why) is None
