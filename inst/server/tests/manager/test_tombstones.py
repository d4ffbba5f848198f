import contextlib
import gc
import weakref

from gym_server.errors import GymServerError
from gym_server.manager.tombstones import Tombstones


def reason(number):
    return GymServerError("call_too_long", f"reason {number}", "hint")


def test_a_reason_is_kept():
    tombstones = Tombstones()
    tombstones.add("a", reason(1))
    found = tombstones.why("a")
    assert (found.code, found.message, found.hint) == ("call_too_long", "reason 1", "hint")
    # An exception must not grow when it is raised repeatedly.
    assert tombstones.why("a") is not found
    assert "a" in tombstones


def test_a_reason_keeps_nothing_of_where_it_was_raised():
    class Environment:
        def step(self, why):
            raise why

    tombstones, why, environment = Tombstones(), reason(1), Environment()
    tombstones.add("a", why)
    with contextlib.suppress(GymServerError):
        environment.step(why)
    gone = weakref.ref(environment)
    del environment, why
    gc.collect()
    assert gone() is None


def test_without_one_an_instance_is_unknown():
    assert Tombstones().why("b").code == "unknown_instance"


def test_only_the_latest_are_kept():
    tombstones = Tombstones(most=3)
    for number in range(5):
        tombstones.add(str(number), reason(number))
    assert [str(number) in tombstones for number in range(5)] == [False, False, True, True, True]
