import contextlib
import gc
import weakref

from gym_server.errors import GymServerError
from gym_server.manager.tombstones import Departed


def reason(number):
    return GymServerError("call_too_long", f"reason {number}", "hint")


def test_a_reason_is_kept():
    departed = Departed()
    departed.add("a", reason(1))
    found = departed.why("a")
    assert (found.code, found.message, found.hint) == ("call_too_long", "reason 1", "hint")
    # What is raised over and over must not grow.
    assert departed.why("a") is not found
    assert "a" in departed


def test_a_reason_keeps_nothing_of_where_it_was_raised():
    class Environment:
        def step(self, why):
            raise why

    departed, why, environment = Departed(), reason(1), Environment()
    departed.add("a", why)
    with contextlib.suppress(GymServerError):
        environment.step(why)
    gone = weakref.ref(environment)
    del environment, why
    gc.collect()
    assert gone() is None


def test_without_one_an_instance_is_unknown():
    assert Departed().why("b").code == "unknown_instance"


def test_only_the_latest_are_kept():
    departed = Departed(most=3)
    for number in range(5):
        departed.add(str(number), reason(number))
    assert [str(number) in departed for number in range(5)] == [False, False, True, True, True]
