import threading

import pytest

from gym_server.rendering.render_thread import RenderThread


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
