"""The pace of an environment that people watch."""

import time

import pytest
from watching import in_background, play, state

from gym_server.viewing import viewer


def is_paced(instance):
    return instance.viewer._next_tick > 0


@pytest.mark.parametrize("how", ["human", "render", "num_envs"])
def test_what_people_want_to_see_moves_in_real_time_while_they_watch(client, create, watch, how):
    made = {"render_mode": "human"} if how != "render" else {}
    url = create(**made, num_envs=2 if how == "num_envs" else None)
    instance, _ = watch(url)
    fields = {"render": True} if how == "render" else {}
    if how == "num_envs":
        fields["action"] = [0, 1]
    client.post(f"{url}/reset/")
    play(client, url, 10, **fields)
    assert not is_paced(instance)
    client.get(f"{url}/watch/presence/")
    began = time.monotonic()
    play(client, url, 26, **fields)
    # CartPole's clock ticks 50 times a second.
    assert time.monotonic() - began >= 0.48


def test_what_nobody_asked_to_see_is_never_held_up(client, create, watch):
    url = create()
    instance, _ = watch(url)
    client.post(f"{url}/reset/")
    state(client, url)
    play(client, url, 5, render=False)
    assert not is_paced(instance)


def test_one_that_is_held_up_holds_up_no_other_and_is_seen(app, client, create):
    slow, quick = create(render_mode="human"), create()
    for url in (slow, quick):
        client.post(f"{url}/reset/")
    client.get(f"{slow}/watch/presence/")
    thread, _ = in_background(play, app.test_client(), slow, 100)
    play(client, quick, 40)
    assert state(client, slow)["step"] < 100
    assert thread.is_alive()
    client.post(f"{slow}/close/")
    thread.join()


@pytest.mark.parametrize(("fps", "expected"), [(50, 50), (None, 30), (0, 30), ("x", 30), (0.1, 30)])
def test_a_speed_that_makes_no_sense_is_the_usual_one(fps, expected):
    assert viewer.usable_fps(fps) == expected


def test_being_watched_is_known_and_is_no_use_of_the_environment(client, create):
    url = create()
    client.post(f"{url}/reset/")
    assert client.get(url).json["watched"] is False
    time.sleep(0.2)
    state(client, url)
    about = client.get(url).json
    assert about["watched"] is True
    assert about["idle_seconds"] >= 0.2
