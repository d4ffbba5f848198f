import threading

import pytest

from gym_server.rendering.render_thread import Occupied, RenderThread


def test_everything_is_drawn_on_one_thread():
    renderer = RenderThread()
    drawn_on = set()
    threads = [
        threading.Thread(target=lambda: drawn_on.add(renderer.run(threading.current_thread).ident))
        for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(drawn_on) == 1
    renderer.stop()


def test_what_drawing_raises_is_raised():
    renderer = RenderThread()
    with pytest.raises(ZeroDivisionError):
        renderer.run(lambda: 1 / 0)
    renderer.stop()


def test_pygame_outlives_an_environment_that_quits_it():
    import pygame

    renderer = RenderThread()
    renderer.run(pygame.font.init)
    renderer.run(lambda: (pygame.display.quit(), pygame.quit()))
    assert renderer.run(pygame.font.get_init)
    renderer.stop()


def test_drawing_may_call_for_drawing():
    renderer = RenderThread()
    threads = renderer.run(lambda: (threading.get_ident(), renderer.run(threading.get_ident)))
    assert threads[0] == threads[1] != threading.get_ident()
    renderer.stop()


@pytest.fixture
def occupied():
    """Return a render thread that is busy until the test releases it, and a function for that."""
    renderer, over = RenderThread(), threading.Event()
    blocker = threading.Thread(target=renderer.run, args=(over.wait, 30))
    blocker.start()
    yield renderer, over.set
    over.set()
    blocker.join(5)
    renderer.stop()


def test_a_job_whose_turn_takes_too_long_is_not_drawn(occupied):
    renderer, go_on = occupied
    drawn = []
    with pytest.raises(Occupied):
        renderer.run_while(lambda: False, drawn.append, "never")
    go_on()
    renderer.run(drawn.append, "later")
    assert drawn == ["later"]


def test_a_job_that_has_begun_is_waited_for():
    renderer, asked = RenderThread(), threading.Event()
    # The function ends only after may_wait was called.
    assert renderer.run_while(asked.set, asked.wait, 30)
    renderer.stop()


def test_a_job_that_may_wait_gets_its_turn(occupied):
    renderer, go_on = occupied
    assert renderer.run_while(lambda: go_on() or True, lambda: "drawn") == "drawn"
