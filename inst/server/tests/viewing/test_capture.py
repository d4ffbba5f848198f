"""What a capture waits for, and what does not wait for it."""

import threading
import time

import pytest
from test_viewer import in_background, play, state

from gym_server.viewing import viewer


@pytest.fixture
def occupied(app, client, faulty, watch):
    """Let another environment draw until the test calls the returned function."""
    url = faulty("Drawing")
    instance, _ = watch(url)
    begun, over = threading.Event(), threading.Event()
    draw = instance.draw

    def for_long():
        begun.set()
        over.wait(30)

    instance.draw = lambda sub_env: instance.renderer.run(for_long) or draw(sub_env)
    client.post(f"{url}/reset/")
    threads = []

    def occupied():
        threads.append(in_background(state, app.test_client(), url)[0])
        assert begun.wait(5)
        return over.set

    yield occupied
    over.set()
    for thread in threads:
        thread.join(5)


def waits_for_its_turn(app):
    """Return whether a watcher waits for another one that has the render thread."""
    return app._renderer._queue.qsize() > 0


def test_a_watcher_that_waits_for_others_drawing_holds_up_no_step(
    app, client, create, occupied, eventually
):
    url = create()
    client.post(f"{url}/reset/")
    end_of_drawing = occupied()
    watcher, seen = in_background(state, app.test_client(), url)
    eventually(lambda: waits_for_its_turn(app))
    player, _ = in_background(play, client, url)
    player.join(5)
    assert not player.is_alive()
    assert watcher.is_alive()
    end_of_drawing()
    watcher.join(5)
    assert seen[0]["step"] == 1
    assert seen[0]["frame"] is not None


@pytest.mark.parametrize("made", [{}, {"num_envs": 2, "vectorization_mode": "async"}])
def test_who_needs_no_drawing_here_does_not_wait_for_others(
    client, app, faulty, create, occupied, made
):
    url = create(**made) if made else faulty("Counting")
    client.post(f"{url}/reset/")
    occupied()
    watcher, seen = in_background(state, app.test_client(), url)
    watcher.join(5)
    assert seen[0]["state"] == "running"


@pytest.mark.parametrize(
    "made", [{}, *({"num_envs": 2, "vectorization_mode": mode} for mode in ("sync", "async"))]
)
def test_what_was_never_drawn_is_made_and_closed_while_others_draw(client, create, occupied, made):
    occupied()
    closing, closed = in_background(lambda: client.post(f"{create(**made)}/close/"))
    closing.join(5)
    assert closed[0].status_code == 204


def test_who_waits_for_others_drawing_hears_of_the_end(app, client, create, occupied, eventually):
    url = create()
    client.post(f"{url}/reset/")
    occupied()
    watcher, answers = in_background(app.test_client().get, f"{url}/watch/state/")
    eventually(lambda: waits_for_its_turn(app))
    app.begin_stop()
    watcher.join(5)
    assert answers[0].json["code"] == "shutting_down"


def test_who_waits_for_others_drawing_for_long_is_told(client, create, occupied, monkeypatch):
    monkeypatch.setattr(viewer, "_LONGEST_WAIT", 0.2)
    url = create()
    client.post(f"{url}/reset/")
    occupied()
    assert state(client, url) == {"number": None, "state": "busy"}


@pytest.mark.parametrize("seconds", [0.0, pytest.param(0.05, marks=pytest.mark.slow)])
@pytest.mark.parametrize("draws_when_stepped", [False, True])
def test_who_is_stepped_all_the_time_is_seen(
    app, client, faulty, watch, draws_when_stepped, seconds
):
    over = threading.Event()

    def play_on(url):
        player = app.test_client()
        while not over.is_set():
            play(player, url)

    urls = [faulty("Drawing", seconds=seconds, length=10**6) for _ in range(2)]
    for url in urls:
        watch(url)[0].draws_when_stepped = draws_when_stepped
        client.post(f"{url}/reset/")
    players = [in_background(play_on, url)[0] for url in urls]
    numbers, end = {0}, time.monotonic() + 60
    while len(numbers) < 5 and time.monotonic() < end:
        numbers.add(state(client, urls[0], after=max(numbers))["number"])
    over.set()
    for player in players:
        player.join(5)
    assert len(numbers) == 5
