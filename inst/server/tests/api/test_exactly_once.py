import threading

import pytest

from gym_server.api.exactly_once import ExactlyOnce, Outcome
from gym_server.errors import GymServerError
from gym_server.protocol.fields import RequestId


class Counter:
    """Counts how often it was done, on an instance or making one."""

    def __init__(self, did_something=True, instance_id=None):
        self.calls = 0
        self.did_something, self.instance_id = did_something, instance_id

    def __call__(self):
        self.calls += 1
        return Outcome(self.calls, self.did_something, self.instance_id)


class Once(ExactlyOnce):
    """One whose calls move the instance "i", if they do not say another."""

    def __init__(self, living=("i",), **limits):
        self.living = set(living)
        super().__init__(self.living.__contains__, **limits)

    def answer(self, request_id, content, act, instance_id="i"):
        if isinstance(act, Counter) and act.instance_id is None:
            act.instance_id = instance_id
        return super().answer(request_id, instance_id, content, act)


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
        args=(RequestId("a", 1), "step", lambda: Outcome((began.set(), may_end.wait(10)))),
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
    assert not once._calls
    assert once.answer(RequestId("a", 1), "step", act) == 1
    once.answer(RequestId("a", 2), "step", refuse)
    # What the key did before is still known.
    assert once.answer(RequestId("a", 1), "step", act) == 1
    assert act.calls == 1


def test_a_repetition_that_waits_for_what_is_refused_is_done():
    once, act = Once(), Counter()
    began, may_end = threading.Event(), threading.Event()

    def refuse():
        began.set()
        assert may_end.wait(10)
        return Outcome("refused", False)

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
    # Who guessed a key blocks nobody's but his own instance.
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
    once, created, stepped = Once(forget_after=0, most_gone=0), Counter(instance_id="i"), Counter()
    once.answer(NUMBER_1, "create", created, None)
    once.answer(NUMBER_1, "step", Counter())
    once.answer(RequestId("b", 1), "step", stepped)
    once.forget()
    assert once.answer(NUMBER_1, "create", created, None) == 1
    assert once.answer(RequestId("b", 1), "step", stepped) == 1
    assert (created.calls, stepped.calls) == (1, 1)
    # Another key's call before it has been idle for so long that nothing is repeated any more.
    assert set(once._calls["i"]) == {"b"}


def test_of_instances_that_are_gone_only_so_many_keys_are_kept():
    once, living = Once(living=["i", "mine"], most_gone=2), Counter()
    once.answer(NUMBER_1, "step", living, "mine")
    for key in "abcd":
        once.answer(RequestId(key, 1), "close", Counter())
    once.living.remove("i")
    once.forget()
    assert set(once._calls["i"]) == {"c", "d"}
    assert once.answer(NUMBER_1, "step", living, "mine") == 1
    assert living.calls == 1


def test_idle_keys_of_an_instance_that_is_gone_are_forgotten():
    once = Once(forget_after=0)
    once.answer(NUMBER_1, "create", Counter(instance_id="i"), None)
    once.answer(NUMBER_1, "close", Counter())
    once.living.clear()
    once.forget()
    assert not once._calls


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
    once, act = Once(forget_after=0, most_gone=0), Counter()

    def meanwhile():
        once.forget()
        return Outcome("slow", True, "i")

    once.living.clear()
    once.answer(NUMBER_1, "step", meanwhile)
    assert once.answer(NUMBER_1, "step", act) == "slow"


def test_what_never_comes_back_is_answered_by_another_thread():
    once, act = Once(), Counter()
    began, may_end = threading.Event(), threading.Event()

    def stuck():
        began.set()
        assert may_end.wait(10)
        return Outcome("too late")

    thread = threading.Thread(target=once.answer, args=(RequestId("a", 1), "step", stuck))
    thread.start()
    assert began.wait(10)
    repetition = []
    waiting = threading.Thread(
        target=lambda: repetition.append(once.answer(RequestId("a", 1), "step", act))
    )
    waiting.start()
    assert once.give_up(thread.ident, lambda request_id: f"gave up {request_id.number}") == (
        "gave up 1"
    )
    waiting.join(10)
    assert repetition == ["gave up 1"]
    assert once.answer(RequestId("a", 2), "step", act) == 1
    may_end.set()
    thread.join(10)
    # What came too late is nobody's answer.
    assert once.answer(RequestId("a", 2), "step", act) == 1
    assert once.give_up(thread.ident, str) is None


def test_what_all_keep_together_is_bounded():
    once = Once(
        living="ijk",
        size=lambda content, answer: 0 if answer is None else len(content) + answer,
        most_bytes=250,
    )
    once.answer(RequestId("first", 1), "", lambda: Outcome(80), "i")
    for instance_id, size in zip("ijk", (90, 70, 150), strict=True):
        done = Outcome(size, True, instance_id)
        once.answer(NUMBER_1, "x" * 10, lambda done=done: done, instance_id)
    once.forget()
    act = Counter()
    # The largest of the last ones had to go as well: it is not done again all the same.
    assert [once.answer(NUMBER_1, "x" * 10, act, one) for one in "ij"] == [90, 70]
    assert conflict(once, RequestId("first", 1), "", act, "i")
    assert conflict(once, NUMBER_1, "x" * 10, act, "k")
    assert act.calls == 0
    assert once.answer(RequestId("a", 2), "step", act, "k") == 1


def test_what_is_kept_is_looked_through_from_time_to_time_and_when_much_came(monkeypatch):
    looks = []
    once = Once(size=lambda content, answer: 100, most_bytes=8 * 250)
    monkeypatch.setattr(once, "forget", lambda: looks.append(1))
    for number in range(1, 6):
        once.answer(RequestId("a", number), "step", Counter())
        once.forget_in_time()
    assert len(looks) == 1
    monkeypatch.setattr("gym_server.api.exactly_once._LOOK_SECONDS", 0.0)
    once.forget_in_time()
    assert len(looks) == 2
