"""Work is ended by its own thread, or by one that answers for it, never by both."""

import threading
import time

from gym_server.threads.in_progress import InProgress


def test_work_that_comes_back_in_time_cannot_be_abandoned():
    work = InProgress()
    work["key"] = 7
    assert work == {"key": 7}
    assert work.finish("key")
    assert not work.abandon("key")
    assert work == {}


def test_a_result_that_comes_after_all_is_not_valid():
    work = InProgress()
    work["key"] = None
    assert work.abandon("key")
    assert not work.abandon("key")
    assert not work.finish("key")


def test_of_two_threads_that_end_work_at_once_one_does():
    work = InProgress()
    for key in range(500):
        work[key] = None
        outcomes, both = [], threading.Barrier(2)

        def end(how, key=key, outcomes=outcomes, both=both):
            both.wait(10)
            outcomes.append(how(key))

        threads = [threading.Thread(target=end, args=(how,)) for how in (work.finish, work.abandon)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(10)
        assert sorted(outcomes) == [False, True]


def test_a_thread_whose_work_was_abandoned_waits_until_it_was_answered_for():
    work, waited = InProgress(), []
    work["key"] = None
    assert work.abandon("key")

    def wait():
        began = time.monotonic()
        work.wait_until_answered("key")
        waited.append(time.monotonic() - began)

    thread = threading.Thread(target=wait)
    thread.start()
    thread.join(0.2)
    assert thread.is_alive()
    work.answered("key")
    thread.join(10)
    assert 0.15 < waited[0] < 5
    # Not a second time.
    wait()
    assert waited[1] < 0.1


def test_nothing_is_kept_of_work_that_was_answered_for():
    work = InProgress()
    work["key"] = None
    work.abandon("key")
    work.answered("key")
    assert (work, work._abandoned) == ({}, {})
