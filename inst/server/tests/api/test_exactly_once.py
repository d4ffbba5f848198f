import threading

import pytest

from gym_server.api.exactly_once import ExactlyOnce
from gym_server.errors import GymServerError
from gym_server.protocol.fields import RequestId
from gym_server.response import Response


class Counter:
    """Counts its calls."""

    def __init__(self, did_something=True):
        self.calls = 0
        self.did_something = did_something

    def __call__(self):
        self.calls += 1
        return outcome(self.calls, self.did_something)


def outcome(text, did_something=True, size=0):
    """Return a response that has a text and a size in bytes, and whether something was done."""
    return Response(200, bytes(size), str(text)), did_something


class Once(ExactlyOnce):
    """An ``ExactlyOnce`` whose calls use the instance "i" by default."""

    def __init__(self, living=("i",), **limits):
        self.living = set(living)
        super().__init__(self.living.__contains__, **limits)

    def answer(self, request_id, content, act, instance_id="i"):
        """Return the text of the response, or the number in it."""
        text = self.respond(request_id, instance_id, content, len(content), act).content_type
        return int(text) if text.isdigit() else text


def conflict(*arguments):
    with pytest.raises(GymServerError) as refusal:
        Once.answer(*arguments)
    return refusal.value.code == "request_conflict"


NUMBER_1 = RequestId("a", 1)


def test_a_repetition_gets_the_stored_answer():
    once, act = Once(), Counter()
    assert [once.answer(NUMBER_1, "step", act) for _ in range(3)] == [1, 1, 1]
    assert act.calls == 1


def test_the_next_number_is_done_and_gaps_are_fine():
    once, act = Once(), Counter()
    assert once.answer(RequestId("a", 0), "step", act) == 1
    assert once.answer(RequestId("a", 1), "step", act) == 2
    assert once.answer(RequestId("a", 10), "step", act) == 3


def test_another_request_under_a_used_number_is_a_conflict():
    once, act = Once(), Counter()
    once.answer(NUMBER_1, "step", act)
    assert conflict(once, NUMBER_1, "reset", act)
    assert act.calls == 1


def test_a_lower_number_is_a_conflict():
    once, act = Once(), Counter()
    once.answer(RequestId("a", 2), "step", act)
    assert conflict(once, NUMBER_1, "step", act)
    assert act.calls == 1


def test_keys_count_for_themselves():
    once, act = Once(), Counter()
    once.answer(RequestId("a", 5), "step", act)
    assert once.answer(RequestId("b", 1), "step", act) == 2


def test_numbers_grow_for_each_instance_by_itself():
    once, act = Once(living=["i", "j"]), Counter()
    once.answer(RequestId("a", 2**62), "step", Counter(), "j")
    assert [once.answer(NUMBER_1, "step", act) for _ in range(2)] == [1, 1]


def answers_of(once, first, others):
    """Return the answers to repetitions that arrive while the first request runs."""
    began, may_end = threading.Event(), threading.Event()

    def slow():
        began.set()
        assert may_end.wait(10)
        return first()

    answers = []
    threads = [
        threading.Thread(target=lambda do=do: answers.append(once.answer(NUMBER_1, "step", do)))
        for do in (slow, *others)
    ]
    threads[0].start()
    assert began.wait(10)
    for thread in threads[1:]:
        thread.start()
    may_end.set()
    for thread in threads:
        thread.join(10)
    return sorted(map(str, answers))


def test_a_repetition_waits_for_the_first_that_still_runs():
    act = Counter()
    assert answers_of(Once(), act, [act] * 3) == ["1"] * 4


def test_a_repetition_that_waits_for_what_is_refused_is_done():
    act = Counter()
    assert answers_of(Once(), lambda: outcome("refused", False), [act, act]) == [
        "1",
        "1",
        "refused",
    ]
    assert act.calls == 1


def test_a_key_does_not_wait_for_another():
    once, act = Once(), Counter()
    began, may_end = threading.Event(), threading.Event()
    slow = threading.Thread(
        target=once.answer,
        args=(NUMBER_1, "step", lambda: outcome((began.set(), may_end.wait(10)))),
    )
    slow.start()
    assert began.wait(10)
    assert once.answer(RequestId("b", 1), "step", act) == 1
    may_end.set()
    slow.join(10)


def test_what_was_refused_before_anything_moved_uses_up_no_number():
    once, refuse, act = Once(), Counter(did_something=False), Counter()
    for number in range(3):
        assert once.answer(RequestId("a", 2**62), "step", refuse) == number + 1
    assert once.answer(NUMBER_1, "step", act) == 1
    once.answer(RequestId("a", 2), "step", refuse)
    # The key's previous request is still known.
    assert once.answer(NUMBER_1, "step", act) == 1
    assert act.calls == 1


def test_creations_have_no_order():
    once, act = Once(), Counter()
    once.answer(RequestId("a", 2**62), "create", Counter(), None)
    assert [once.answer(NUMBER_1, "create", act, None) for _ in range(2)] == [1, 1]


def test_of_many_creations_the_oldest_are_refused_and_never_done_again():
    once, act = Once(most_unordered=3), Counter()
    for number in (2, 1, 4, 5, 6):
        once.answer(RequestId("a", number), "create", act, None)
    assert once.answer(RequestId("a", 4), "create", act, None) == 3
    assert all(conflict(once, RequestId("a", n), "create", act, None) for n in (0, 1, 2))
    assert once.answer(RequestId("a", 3), "create", act, None) == 6
    assert once.answer(RequestId("b", 1), "create", act, None) == 7


def test_what_is_known_of_an_instance_goes_with_it():
    once, kept, act = Once(living=["i", "mine"]), Counter(), Counter()
    once.answer(NUMBER_1, "step", kept, "mine")
    once.answer(NUMBER_1, "step", lambda: outcome("large", size=1000))
    once.living.remove("i")
    once.forget_closed()
    assert once._bytes == len("step")
    # Nothing is remembered of calls to one that does not exist.
    assert [once.answer(NUMBER_1, "step", act) for _ in range(2)] == [1, 2]
    assert list(once._rows) == ["mine"]
    assert once.answer(NUMBER_1, "step", kept, "mine") == 1
    assert kept.calls == 1


def test_what_all_keep_together_is_bounded_and_nothing_is_done_again():
    once, act = Once(living="ijk", most_bytes=320), Counter()
    for instance_id, size in zip("ijk", (150, 90, 70), strict=True):
        once.answer(NUMBER_1, "x" * 10, lambda size=size: outcome(size, size=size), instance_id)
    # The oldest one was dropped.
    assert [once.answer(NUMBER_1, "x" * 10, act, one) for one in "jk"] == [90, 70]
    assert conflict(once, NUMBER_1, "x" * 10, act, "i")
    assert act.calls == 0
    assert once.answer(RequestId("a", 2), "x" * 10, act, "i") == 1
    assert once._bytes == sum(once._sizes.values()) == 190
    # One that is larger than all may be together is not kept.
    assert once.answer(RequestId("a", 3), "", lambda: outcome("huge", size=321), "i") == "huge"
    assert conflict(once, RequestId("a", 3), "", act, "i")
    assert once._bytes == 0
