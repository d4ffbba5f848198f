import threading

import pytest

from gym_server.errors import GymServerError
from gym_server.exactly_once import ExactlyOnce, RequestId


class Counter:
    def __init__(self):
        self.calls = 0

    def __call__(self):
        self.calls += 1
        return self.calls


def conflict(*arguments):
    with pytest.raises(GymServerError) as refusal:
        ExactlyOnce.answer(*arguments)
    return refusal.value.code == "request_conflict"


def test_a_repetition_gets_the_stored_answer():
    once, act = ExactlyOnce(), Counter()
    assert [once.answer(RequestId("a", 1), "step", act) for _ in range(3)] == [1, 1, 1]
    assert act.calls == 1


def test_the_next_number_is_done_and_gaps_are_fine():
    once, act = ExactlyOnce(), Counter()
    assert once.answer(RequestId("a", 0), "step", act) == 1
    assert once.answer(RequestId("a", 1), "step", act) == 2
    assert once.answer(RequestId("a", 10), "step", act) == 3


def test_another_request_under_a_used_number_is_a_conflict():
    once, act = ExactlyOnce(), Counter()
    once.answer(RequestId("a", 1), "step", act)
    assert conflict(once, RequestId("a", 1), "reset", act)
    assert act.calls == 1


def test_a_lower_number_is_a_conflict():
    once, act = ExactlyOnce(), Counter()
    once.answer(RequestId("a", 2), "step", act)
    assert conflict(once, RequestId("a", 1), "step", act)
    assert act.calls == 1


def test_keys_count_for_themselves():
    once, act = ExactlyOnce(), Counter()
    once.answer(RequestId("a", 5), "step", act)
    assert once.answer(RequestId("b", 1), "step", act) == 2


def test_a_repetition_waits_for_the_first_that_still_runs():
    once, act = ExactlyOnce(), Counter()
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
    once, act = ExactlyOnce(), Counter()
    began, may_end = threading.Event(), threading.Event()
    slow = threading.Thread(
        target=once.answer,
        args=(RequestId("a", 1), "step", lambda: (began.set(), may_end.wait(10))),
    )
    slow.start()
    assert began.wait(10)
    assert once.answer(RequestId("b", 1), "step", act) == 1
    may_end.set()
    slow.join(10)


def test_idle_keys_are_forgotten_when_another_comes():
    once, act = ExactlyOnce(forget_after=0), Counter()
    once.answer(RequestId("a", 1), "step", act)
    once.answer(RequestId("b", 1), "step", act)
    assert once.answer(RequestId("a", 1), "step", act) == 3


def test_a_key_that_is_in_use_is_not_forgotten():
    once, act = ExactlyOnce(forget_after=0), Counter()

    def meanwhile():
        once.answer(RequestId("b", 1), "step", act)
        return "slow"

    once.answer(RequestId("a", 1), "step", meanwhile)
    assert once.answer(RequestId("a", 1), "step", act) == "slow"


def test_a_key_is_forgotten_once_it_has_been_idle():
    once, act = ExactlyOnce(forget_after=0), Counter()
    once.answer(RequestId("a", 1), "step", act)
    once.forget()
    assert once.answer(RequestId("a", 1), "step", act) == 2


def test_only_so_many_keys_are_kept():
    once, act = ExactlyOnce(most=20), Counter()
    for number in range(30):
        once.answer(RequestId(str(number), 1), "step", act)
    assert len(once._keys) <= 20
    # The latest are among them.
    assert once.answer(RequestId("29", 1), "step", act) == 30
    assert once.answer(RequestId("0", 1), "step", act) == 31


def test_what_never_comes_back_is_answered_by_another_thread():
    once, act = ExactlyOnce(), Counter()
    began, may_end = threading.Event(), threading.Event()

    def stuck():
        began.set()
        assert may_end.wait(10)
        return "too late"

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
    once = ExactlyOnce(size=lambda content, answer: len(content) + answer, most_bytes=250)
    for number, key in enumerate("abc"):
        once.answer(RequestId(key, 1), "x" * 10, lambda: 90)
        assert number < 2 or once.answer(RequestId("a", 1), "x" * 10, Counter()) == 90
    once.forget()
    # The one that was used longest ago is done anew.
    act = Counter()
    assert [once.answer(RequestId(key, 1), "x" * 10, act) for key in "acb"] == [90, 90, 1]
