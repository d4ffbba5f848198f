import threading

import pytest

from gym_server.api.exactly_once import ExactlyOnce, Outcome
from gym_server.errors import GymServerError
from gym_server.protocol.fields import RequestId
from gym_server.response import Response


class Counter:
    """Counts its calls, which use or create an instance."""

    def __init__(self, did_something=True, instance_id=None):
        self.calls = 0
        self.did_something, self.instance_id = did_something, instance_id

    def __call__(self):
        self.calls += 1
        return outcome(self.calls, self.did_something, self.instance_id)


def outcome(text, *what, size=0):
    """Return an outcome whose response has a text and a size in bytes."""
    return Outcome(Response(200, bytes(size), str(text)), *what)


class Once(ExactlyOnce):
    """An ``ExactlyOnce`` whose calls use the instance "i" by default."""

    def __init__(self, living=("i",), **limits):
        self.living = set(living)
        super().__init__(self.living.__contains__, **limits)

    def answer(self, request_id, content, act, instance_id="i"):
        """Return the text of the response, or the number in it."""
        if isinstance(act, Counter) and act.instance_id is None:
            act.instance_id = instance_id
        text = self.respond(request_id, instance_id, content, len(content), act).content_type
        return int(text) if text.isdigit() else text


def conflict(*arguments):
    return refused(*arguments) == "request_conflict"


def refused(*arguments):
    with pytest.raises(GymServerError) as refusal:
        Once.answer(*arguments)
    return refusal.value.code


def test_a_repetition_gets_the_stored_answer():
    once, act = Once(), Counter()
    assert [once.answer(RequestId("a", 1), "step", act) for _ in range(3)] == [1, 1, 1]
    assert act.calls == 1


def test_the_next_number_is_done_and_gaps_are_fine():
    once, act = Once(), Counter()
    assert once.answer(RequestId("a", 0), "step", act) == 1
    assert once.answer(RequestId("a", 1), "step", act) == 2
    assert once.answer(RequestId("a", 10), "step", act) == 3


def test_another_request_under_a_used_number_is_a_conflict():
    once, act = Once(), Counter()
    once.answer(RequestId("a", 1), "step", act)
    assert conflict(once, RequestId("a", 1), "reset", act)
    assert act.calls == 1


def test_a_lower_number_is_a_conflict():
    once, act = Once(), Counter()
    once.answer(RequestId("a", 2), "step", act)
    assert conflict(once, RequestId("a", 1), "step", act)
    assert act.calls == 1


def test_keys_count_for_themselves():
    once, act = Once(), Counter()
    once.answer(RequestId("a", 5), "step", act)
    assert once.answer(RequestId("b", 1), "step", act) == 2


def test_a_repetition_waits_for_the_first_that_still_runs():
    once, act = Once(), Counter()
    began, may_end = threading.Event(), threading.Event()

    def slow():
        began.set()
        assert may_end.wait(10)
        return act()

    answers = []
    threads = [
        threading.Thread(
            target=lambda: answers.append(once.answer(RequestId("a", 1), "step", slow))
        )
        for _ in range(4)
    ]
    threads[0].start()
    assert began.wait(10)
    for thread in threads[1:]:
        thread.start()
    may_end.set()
    for thread in threads:
        thread.join(10)
    assert answers == [1, 1, 1, 1]


def test_a_key_does_not_wait_for_another():
    once, act = Once(), Counter()
    began, may_end = threading.Event(), threading.Event()
    slow = threading.Thread(
        target=once.answer,
        args=(RequestId("a", 1), "step", lambda: outcome((began.set(), may_end.wait(10)))),
    )
    slow.start()
    assert began.wait(10)
    assert once.answer(RequestId("b", 1), "step", act) == 1
    may_end.set()
    slow.join(10)


def test_what_was_refused_before_anything_moved_leaves_nothing():
    once, refuse, act = Once(), Counter(did_something=False), Counter()
    for number in range(3):
        assert once.answer(RequestId("a", 2**62), "step", refuse) == number + 1
    assert not once._table
    assert once.answer(RequestId("a", 1), "step", act) == 1
    once.answer(RequestId("a", 2), "step", refuse)
    # The key's previous request is still known.
    assert once.answer(RequestId("a", 1), "step", act) == 1
    assert act.calls == 1


def test_a_repetition_that_waits_for_what_is_refused_is_done():
    once, act = Once(), Counter()
    began, may_end = threading.Event(), threading.Event()

    def refuse():
        began.set()
        assert may_end.wait(10)
        return outcome("refused", False)

    answers = []
    threads = [
        threading.Thread(target=lambda do=do: answers.append(once.answer(NUMBER_1, "step", do)))
        for do in (refuse, act, act)
    ]
    threads[0].start()
    assert began.wait(10)
    for thread in threads[1:]:
        thread.start()
    may_end.set()
    for thread in threads:
        thread.join(10)
    assert (sorted(map(str, answers)), act.calls) == (["1", "1", "refused"], 1)


NUMBER_1 = RequestId("a", 1)


def test_numbers_grow_for_each_instance_by_itself():
    once, act = Once(living=["i", "j"]), Counter()
    # A guessed key blocks only the instance that it is used on.
    once.answer(RequestId("a", 2**62), "step", Counter(), "j")
    assert once.answer(NUMBER_1, "step", act) == 1
    assert once.answer(NUMBER_1, "step", act) == 1
    assert act.calls == 1


def test_creations_have_no_order():
    once = Once(living=["i", "j"])
    once.answer(RequestId("a", 2**62), "create", Counter(instance_id="j"), None)
    act = Counter(instance_id="i")
    assert [once.answer(NUMBER_1, "create", act, None) for _ in range(2)] == [1, 1]
    assert act.calls == 1


def test_the_last_call_on_a_living_instance_and_its_creation_are_never_forgotten():
    once, created, stepped = Once(kept_seconds=0, most_gone=0, most_keys=2), Counter(), Counter()
    created.instance_id = "i"
    once.answer(NUMBER_1, "create", created, None)
    once.answer(NUMBER_1, "step", Counter())
    once.answer(RequestId("b", 1), "step", stepped)
    # Another key was idle for so long that it makes room.
    refuse = Counter(did_something=False)
    once.answer(RequestId("c", 1), "step", refuse)
    assert set(once._table["i"]) == {"b"}
    assert once.answer(NUMBER_1, "create", created, None) == 1
    assert once.answer(RequestId("b", 1), "step", stepped) == 1
    assert (created.calls, stepped.calls) == (1, 1)


def test_what_is_known_of_instances_that_are_gone_is_dropped_when_many_rows_have_come():
    once, living = Once(living=["i", "mine"], most_gone=3), Counter()
    once.answer(NUMBER_1, "step", living, "mine")
    once.answer(NUMBER_1, "create", Counter(instance_id="i"), None)
    once.answer(NUMBER_1, "step", Counter())
    once.living.remove("i")
    assert set(once._table) == {"mine", None, "i"}
    once.answer(NUMBER_1, "create", Counter(instance_id="j"), None)
    once.answer(RequestId("b", 1), "create", Counter(instance_id="mine"), None)
    assert set(once._table) == {"mine", None}
    assert set(once._table[None]) == {RequestId("b", 1)}
    assert once.answer(NUMBER_1, "step", living, "mine") == 1
    assert living.calls == 1


def test_an_instance_takes_only_so_many_keys_and_goes_on_with_those():
    once, act = Once(most_keys=3), Counter()
    for key in "abc":
        once.answer(RequestId(key, 1), "step", act)
    late = Counter()
    assert refused(once, RequestId("d", 1), "step", late) == "too_many_keys"
    assert late.calls == 0
    assert [once.answer(RequestId(key, 1), "step", late) for key in "abc"] == [1, 2, 3]
    assert once.answer(RequestId("a", 2), "step", act) == 4


def test_a_key_that_is_in_use_is_not_forgotten():
    once, act = Once(living=[], most_gone=0), Counter()

    def meanwhile():
        once.answer(RequestId("other", 1), "step", Counter(), "j")
        return outcome("slow", True, "i")

    once.answer(NUMBER_1, "step", Counter())
    assert once.answer(RequestId("a", 2), "step", meanwhile) == "slow"
    assert once.answer(RequestId("a", 2), "step", act) == "slow"
    assert act.calls == 0


def test_what_all_keep_together_is_bounded_and_nothing_is_done_again():
    once = Once(living="ijk", most_bytes=320)
    once.answer(RequestId("first", 1), "", lambda: outcome("first", size=80), "i")
    for instance_id, size in zip("ijk", (90, 70, 150), strict=True):
        once.answer(
            NUMBER_1, "x" * 10, lambda size=size: outcome(size, True, size=size), instance_id
        )
    act = Counter()
    # The largest one was dropped.
    assert [once.answer(NUMBER_1, "x" * 10, act, one) for one in "ij"] == [90, 70]
    assert once.answer(RequestId("first", 1), "", act, "i") == "first"
    assert conflict(once, NUMBER_1, "x" * 10, act, "k")
    assert act.calls == 0
    assert once.answer(RequestId("a", 2), "step", act, "k") == 1
    assert once._bytes == sum(row.size for rows in once._table.values() for row in rows.values())
