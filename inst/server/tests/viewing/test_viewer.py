"""What the watchers of an environment see, and when it is drawn for them."""

import base64
import threading
import time

import numpy as np
import pytest
from pictures import decode
from watching import in_background, play, state

from gym_server.viewing import viewer


def frame_of(seen):
    return decode(base64.b64decode(seen["frame"]))


# What there is to see ---------------------------------------------------------------------


def test_a_watcher_sees_the_frame_and_the_numbers_that_belong_to_it(client, create):
    url = create(seed=1)
    client.post(f"{url}/reset/")
    play(client, url, 3)
    seen = state(client, url)
    assert frame_of(seen).shape == (400, 600, 3)
    shown = {name: seen[name] for name in ("env_id", "state", "episode", "step", "return")}
    assert shown == {
        "env_id": "CartPole-v1",
        "state": "running",
        "episode": 1,
        "step": 3,
        "return": 3.0,
    }
    assert (seen["num_envs"], seen["returns"], seen["reward_threshold"]) == (None, [], 475.0)


def test_episodes_and_returns_are_counted_unwatched_too(client, faulty):
    url = faulty("Counting", length=2)
    for _ in range(3):
        client.post(f"{url}/reset/")
        play(client, url, 2)
    seen = state(client, url)
    assert (seen["episode"], seen["step"], seen["state"]) == (3, 2, "ended")
    assert seen["returns"] == [3.0, 3.0, 3.0]


def test_before_the_first_reset_it_says_so(client, create):
    seen = state(client, create())
    assert (seen["state"], seen["frame"], seen["episode"]) == ("not_reset", None, 0)


@pytest.mark.parametrize(
    ("name", "kwargs", "why"),
    [
        ("Counting", {}, "draws no pictures"),
        ("Drawing", {"frame": "nothing"}, "does not return a picture"),
        ("Drawing", {"frame": "raises"}, "out of paint"),
    ],
)
def test_what_cannot_be_drawn_shows_its_observation_and_says_why(client, faulty, name, kwargs, why):
    url = faulty(name, **kwargs)
    client.post(f"{url}/reset/")
    play(client, url, 2)
    seen = state(client, url)
    assert seen["frame"] is None
    assert why in seen["why_no_picture"]
    assert seen["observation"] == {"names": ["[0]"], "values": [2], "size": 1}


def test_values_that_json_has_no_word_for_are_seen(client, faulty):
    url = faulty("NotANumber")
    client.post(f"{url}/reset/")
    assert state(client, url)["observation"]["values"][:3] == ["NaN", "Infinity", "-Infinity"]


@pytest.mark.parametrize("mode", ["sync", "vector_entry_point", "async"])
def test_each_sub_env_can_be_watched(client, create, mode):
    url = create(num_envs=3, vectorization_mode=mode, seed=1)
    client.post(f"{url}/reset/")
    for _ in range(8):
        play(client, url, action=[0, 1, 1])
    seen = [state(client, url, sub_env=sub_env) for sub_env in range(3)]
    assert [(one["sub_env"], one["num_envs"], one["step"]) for one in seen] == [
        (0, 3, 8),
        (1, 3, 8),
        (2, 3, 8),
    ]
    # The carts moved differently.
    assert not np.array_equal(frame_of(seen[0]), frame_of(seen[1]))
    refused = client.get(f"{url}/watch/state/?sub_env=3")
    assert (refused.status_code, refused.json["code"]) == (400, "invalid_parameter")


def test_more_sub_envs_than_can_be_drawn_at_once_show_their_observations(client, create):
    url = create(num_envs=20, vectorization_mode="vector_entry_point", seed=1)
    observations = client.post(f"{url}/reset/").json["observation"]
    seen = state(client, url, sub_env=19)
    assert seen["frame"] is None
    assert "all of its 20 sub-environments at once" in seen["why_no_picture"]
    assert seen["observation"]["values"] == pytest.approx(observations[19])


def test_the_observation_of_a_sub_env_is_its_own_when_only_others_stepped(app, client, sub_envs):
    url = sub_envs("bytes", num_envs=3, longest=9, vectorization_mode="sync")
    instance = app._instances.get(url.rsplit("/", 1)[1])
    before = client.post(f"{url}/reset/", json={"seed": 1}).json["observation"]
    fields = {"action": [[0] * 4] * 2, "step_mask": [True, False, True]}
    after = client.post(f"{url}/step/", json=fields).json["observation"]
    seen = [instance._observed(i).tolist() for i in range(3)]
    assert seen == [after[0], before[1], after[1]]


# When it is drawn -------------------------------------------------------------------------


def test_nothing_is_drawn_unwatched(client, create, watch):
    url = create(render_mode="human")
    _, drawn = watch(url)
    client.post(f"{url}/reset/")
    play(client, url, 5, render=True)
    assert drawn == []


def test_an_environment_that_nobody_steps_is_drawn_once(client, create, watch, monkeypatch):
    monkeypatch.setattr(viewer, "_LONGEST_WAIT", 0.3)
    url = create()
    _, drawn = watch(url)
    client.post(f"{url}/reset/")
    first = state(client, url)
    assert first["frame"] is not None
    again = state(client, url, after=first["number"])
    assert again["number"] == first["number"]
    assert drawn == [0]


def test_a_watcher_waits_for_the_next_move(client, create, watch):
    url = create()
    _, drawn = watch(url)
    client.post(f"{url}/reset/")
    first = state(client, url)
    thread, later = in_background(
        state, client.application.test_client(), url, after=first["number"]
    )
    time.sleep(0.2)
    assert later == []
    play(client, url)
    thread.join(5)
    assert later[0]["step"] == 1
    assert len(drawn) == 2


def test_who_has_left_has_nothing_drawn(client, create, watch):
    url = create()
    _, drawn = watch(url)
    client.post(f"{url}/reset/")
    state(client, url)
    play(client, url, 100)
    assert len(drawn) == 1


def test_a_frame_is_drawn_once_for_all_who_watch(app, client, create, watch):
    url = create()
    _, drawn = watch(url)
    client.post(f"{url}/reset/")
    first = state(client, url)["number"]
    watchers = [in_background(state, app.test_client(), url, after=first) for _ in range(6)]
    time.sleep(0.2)
    play(client, url)
    for thread, _ in watchers:
        thread.join(5)
    assert {results[0]["number"] for _, results in watchers} == {first + 1}
    assert len(drawn) == 2


def test_the_latest_wins_and_is_seen_when_the_steps_end(client, create):
    url = create()
    client.post(f"{url}/reset/")
    seen = state(client, url)
    play(client, url, 7)
    while seen["step"] < 7:
        seen = state(client, url, after=seen["number"])
    assert seen["step"] == 7


@pytest.mark.slow
def test_pictures_keep_their_distance(client, faulty, watch, monkeypatch):
    monkeypatch.setattr(viewer, "_LEAST_SECONDS", 0.2)
    url = faulty("Drawing")
    _, drawn = watch(url)
    client.post(f"{url}/reset/")
    began = time.monotonic()
    number = None
    while time.monotonic() - began < 1:
        number = state(client, url, **({} if number is None else {"after": number}))["number"]
        play(client, url)
    assert 2 <= len(drawn) <= 1 + (time.monotonic() - began) / 0.2


@pytest.mark.slow
def test_slow_drawing_leaves_most_of_the_time_to_the_steps(client, faulty, watch):
    url = faulty("Drawing")
    instance, drawn = watch(url)
    draw = instance.draw

    def slowly(sub_env):
        time.sleep(0.05)
        return draw(sub_env)

    instance.draw = slowly
    client.post(f"{url}/reset/")
    number = state(client, url)["number"]
    began = time.monotonic()
    while time.monotonic() - began < 1.5:
        play(client, url)
        number = state(client, url, after=number)["number"]
    # A fifth of the time; half would be more. The second one comes a little early.
    assert 2 <= len(drawn) <= 2 + (time.monotonic() - began) / 0.25


def test_a_step_that_takes_long_is_told(client, app, faulty, monkeypatch):
    monkeypatch.setattr(viewer, "_LOCK_TIMEOUT", 0.2)
    url = faulty("Counting", seconds=1.0)
    client.post(f"{url}/reset/")
    thread, _ = in_background(play, app.test_client(), url)
    time.sleep(0.2)
    assert state(client, url) == {"number": None, "state": "busy"}
    thread.join()
    assert state(client, url)["step"] == 1


def test_one_never_drawn_whose_turn_is_far_off_is_told_in_time(client, faulty, watch, monkeypatch):
    monkeypatch.setattr(viewer, "_LONGEST_WAIT", 0.3)
    url = faulty("Drawing")
    instance, _ = watch(url)
    client.post(f"{url}/reset/")
    instance.viewer._due = time.monotonic() + 3600
    thread, seen = in_background(state, client.application.test_client(), url)
    thread.join(5)
    assert seen == [{"number": None, "state": "busy"}]


# While others draw ---------------------------------------------------------------------------


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


# The end ------------------------------------------------------------------------------------


def test_who_watches_while_it_is_closed_hears_of_it(app, client, create):
    url = create()
    client.post(f"{url}/reset/")
    number = state(client, url)["number"]
    thread, answers = in_background(app.test_client().get, f"{url}/watch/state/?after={number}")
    time.sleep(0.2)
    client.post(f"{url}/close/")
    thread.join(5)
    assert (answers[0].status_code, answers[0].json["code"]) == (400, "unknown_instance")


def test_at_the_end_all_watchers_are_sent_away(app, client, create):
    urls = [create() for _ in range(3)]
    waiting = []
    for url in urls:
        client.post(f"{url}/reset/")
        number = state(client, url)["number"]
        waiting.append(in_background(app.test_client().get, f"{url}/watch/state/?after={number}"))
    time.sleep(0.2)
    app.begin_stop()
    for thread, answers in waiting:
        thread.join(5)
        assert (answers[0].status_code, answers[0].json["code"]) == (503, "shutting_down")
