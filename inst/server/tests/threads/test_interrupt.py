import threading

import pytest

from gym_server.threads.interrupt import interrupt, interrupted_by


@pytest.fixture
def in_thread():
    """Run a function in a thread until it waits; return the thread and the result."""

    def in_thread(play):
        came, waits = [], threading.Event()

        def run():
            try:
                came.append(play(waits.set))
            except BaseException as error:
                came.append(type(error))

        thread = threading.Thread(target=run)
        thread.start()
        assert waits.wait(10)
        return thread, came

    return in_thread


def loop(waits):
    waits()
    while True:
        pass


def test_an_interrupt_ends_a_loop(in_thread):
    thread, came = in_thread(loop)
    interrupt(thread.ident)
    thread.join(10)
    assert came == [SystemExit]


def test_what_is_broken_off_otherwise_gets_to_its_end_first(in_thread):
    broken_off, steps = threading.Event(), []

    def play(waits):
        with interrupted_by(broken_off.set):
            waits()
            # Like a lock in C: no exception can interrupt it.
            assert broken_off.wait(10)
            steps.append("the rest")
        steps.append("what follows")

    thread, came = in_thread(play)
    interrupt(thread.ident)
    thread.join(10)
    assert (came, steps) == ([SystemExit], ["the rest"])


def test_what_nobody_interrupted_goes_on_and_an_interrupt_ends_it_later(in_thread):
    broken_off = []

    def play(waits):
        with interrupted_by(lambda: broken_off.append(1)):
            pass
        loop(waits)

    thread, came = in_thread(play)
    interrupt(thread.ident)
    thread.join(10)
    assert (came, broken_off) == ([SystemExit], [])
