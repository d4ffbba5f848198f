import csv
import shutil
import sys

import pytest

pytest.importorskip("moviepy")
# moviepy depends on it.
count_frames_and_secs = pytest.importorskip("imageio_ffmpeg").count_frames_and_secs


def rows(directory):
    with open(directory / "episodes.csv", newline="") as table:
        return list(csv.reader(table))


def episode(client, url, seed=0):
    client.post(f"{url}/reset/", json={"seed": seed})
    total = length = 0
    while True:
        answer = client.post(f"{url}/step/", json={"action": 1}).json
        total, length = total + answer["reward"], length + 1
        if answer["done"]:
            return total, length


def start(client, url, directory="run", **fields):
    answer = client.post(f"{url}/monitor/start/", json={"directory": directory, **fields})
    return answer.json["code"] if answer.json else answer.status_code


def stop(client, url):
    assert client.post(f"{url}/monitor/close/").status_code == 204


def videos(directory):
    return sorted(path.name for path in directory.glob("*.mp4"))


def test_an_episode_is_a_row_as_soon_as_it_is_done(client, create, monitor_dir):
    url = create()
    assert start(client, url) == 204
    total, length = episode(client, url)
    header, row = rows(monitor_dir / "run")
    assert header == ["episode", "return", "length", "seconds"]
    assert row[:3] == ["0", str(total), str(length)]
    assert 0 < float(row[3]) < 60


def test_returns_keep_their_digits(client, create, monitor_dir):
    url = create("Pendulum-v1", kwargs={"max_episode_steps": 3})
    start(client, url)
    client.post(f"{url}/reset/", json={"seed": 1})
    rewards = [client.post(f"{url}/step/", json={"action": 0}).json["reward"] for _ in range(3)]
    assert float(rows(monitor_dir / "run")[1][1]) == sum(rewards)


def test_nothing_after_done_until_the_next_reset(client, create, monitor_dir):
    url = create()
    start(client, url)
    episode(client, url)
    for _ in range(3):
        client.post(f"{url}/step/", json={"action": 1})
    assert len(rows(monitor_dir / "run")) == 2
    episode(client, url)
    assert [row[0] for row in rows(monitor_dir / "run")[1:]] == ["0", "1"]


def test_an_episode_that_is_given_up_leaves_a_gap(client, create, monitor_dir):
    url = create()
    start(client, url)
    client.post(f"{url}/reset/")
    client.post(f"{url}/step/", json={"action": 1})
    episode(client, url)
    assert [row[0] for row in rows(monitor_dir / "run")[1:]] == ["1"]


def test_an_episode_under_way_is_not_recorded(client, create, monitor_dir):
    url = create()
    client.post(f"{url}/reset/", json={"seed": 0})
    start(client, url, video_callable=True)
    while not client.post(f"{url}/step/", json={"action": 1}).json["done"]:
        pass
    assert len(rows(monitor_dir / "run")) == 1
    episode(client, url)
    assert [row[0] for row in rows(monitor_dir / "run")[1:]] == ["0"]


def test_a_reset_that_fails_is_no_episode(client, faulty, monitor_dir):
    url = faulty("RaisesInReset", length=1)
    start(client, url)
    assert client.post(f"{url}/reset/").status_code == 500
    client.post(f"{url}/reset/", json={"options": {"fix": True}})
    client.post(f"{url}/step/", json={"action": 0})
    assert [row[0] for row in rows(monitor_dir / "run")[1:]] == ["0"]


def test_an_instance_tells_of_its_monitor(client, create, monitor_dir):
    url = create()
    start(client, url)
    episode(client, url)
    assert client.get(url).json["monitor"] == {
        "directory": str(monitor_dir / "run"),
        "table": "episodes.csv",
        "episodes": 1,
    }
    stop(client, url)
    assert client.get(url).json["monitor"] is None


def test_there_is_one_monitor_at_a_time(client, create):
    url = create()
    assert start(client, url) == 204
    assert start(client, url, "other") == "monitor_active"
    stop(client, url)
    assert start(client, url, "other") == 204


def test_closing_a_monitor_that_there_is_not_is_no_error(client, create):
    url = create()
    stop(client, url)
    assert start(client, url) == 204
    stop(client, url)
    stop(client, url)


def test_closing_a_monitor_leaves_the_environment_open(client, create):
    url = create()
    start(client, url, video_callable=True)
    client.post(f"{url}/reset/")
    stop(client, url)
    assert client.post(f"{url}/step/", json={"action": 0}).status_code == 200


def test_videos_are_made_of_every_nth_episode(client, create, monitor_dir):
    url = create()
    start(client, url, video_callable=2)
    for _ in range(3):
        episode(client, url)
    assert videos(monitor_dir / "run") == ["rl-video-episode-0.mp4", "rl-video-episode-2.mp4"]
    assert (monitor_dir / "run" / "rl-video-episode-0.mp4").stat().st_size > 1000


def test_a_video_has_all_frames(client, faulty, monitor_dir):
    url = faulty("Drawing", length=50)
    start(client, url, video_callable=True)
    client.post(f"{url}/reset/")
    for _ in range(50):
        client.post(f"{url}/step/", json={"action": 0})
    frames, seconds = count_frames_and_secs(str(monitor_dir / "run" / "rl-video-episode-0.mp4"))
    assert (frames, round(seconds, 2)) == (51, 1.7)


def test_an_encoder_that_fails_is_told_of(client, create, monitor_dir):
    url = create()
    start(client, url, video_callable=True)
    (monitor_dir / "run" / "rl-video-episode-0.mp4").mkdir()
    assert episode(client, url)[1] > 0
    answer = client.post(f"{url}/monitor/close/")
    assert (answer.status_code, answer.json["code"]) == (400, "monitor_directory")


@pytest.mark.parametrize("fields", [{}, {"video_callable": False}, {"video_callable": None}])
def test_without_being_asked_no_video_is_made(client, create, monitor_dir, fields):
    url = create()
    start(client, url, **fields)
    episode(client, url)
    assert videos(monitor_dir / "run") == []


def test_a_video_has_the_number_of_its_episode(client, create, monitor_dir):
    url = create()
    start(client, url, video_callable=True)
    client.post(f"{url}/reset/")
    client.post(f"{url}/step/", json={"action": 0})
    episode(client, url)
    assert [row[0] for row in rows(monitor_dir / "run")[1:]] == ["1"]
    assert videos(monitor_dir / "run") == ["rl-video-episode-0.mp4", "rl-video-episode-1.mp4"]


@pytest.mark.parametrize("end", ["monitor/close/", "close/"])
def test_a_video_under_way_is_finished(client, create, monitor_dir, end):
    url = create()
    start(client, url, video_callable=True)
    client.post(f"{url}/reset/")
    client.post(f"{url}/step/", json={"action": 0})
    assert client.post(f"{url}/{end}").status_code == 204
    assert videos(monitor_dir / "run") == ["rl-video-episode-0.mp4"]


def test_a_server_that_ends_finishes_its_monitors(app, client, create, monitor_dir):
    url = create()
    start(client, url, video_callable=True)
    client.post(f"{url}/reset/")
    client.post(f"{url}/step/", json={"action": 0})
    app._instances.close_all()
    assert videos(monitor_dir / "run") == ["rl-video-episode-0.mp4"]


def test_resuming_goes_on_counting_time_after_time(client, create, monitor_dir):
    for _ in range(3):
        url = create()
        assert start(client, url, resume=True, video_callable=2) == 204
        episode(client, url)
        client.post(f"{url}/reset/")
        client.post(f"{url}/close/")
    assert [row[0] for row in rows(monitor_dir / "run")] == ["episode", "0", "1", "3"]
    assert videos(monitor_dir / "run") == [f"rl-video-episode-{n}.mp4" for n in (0, 2, 4)]


def test_videos_need_an_environment_that_draws(client, faulty, monitor_dir):
    url = faulty("Counting")
    assert start(client, url, video_callable=True) == "video_unavailable"
    assert not (monitor_dir / "run").exists()
    assert start(client, url) == 204


def test_videos_need_moviepy_and_nothing_is_deleted_before(
    client, create, monitor_dir, monkeypatch
):
    url = create()
    start(client, url)
    episode(client, url)
    stop(client, url)
    monkeypatch.setitem(sys.modules, "moviepy", None)
    assert start(client, url, video_callable=True, force=True) == "video_unavailable"
    assert len(rows(monitor_dir / "run")) == 2
    assert start(client, url, resume=True) == 204


def test_a_directory_that_vanishes_does_not_stop_the_environment(client, create, monitor_dir):
    url = create()
    start(client, url, video_callable=True)
    episode(client, url)
    shutil.rmtree(monitor_dir / "run")
    episode(client, url)
    answer = client.post(f"{url}/monitor/close/")
    assert (answer.status_code, answer.json["code"]) == (400, "monitor_directory")
    assert start(client, url) == 204


def test_a_video_that_cannot_be_written_does_not_lose_the_step(client, create, monkeypatch):
    from gymnasium.wrappers import RecordVideo

    def fail(self):
        raise OSError("no space left")

    url = create()
    start(client, url, video_callable=True)
    monkeypatch.setattr(RecordVideo, "stop_recording", fail)
    assert episode(client, url)[1] > 0
    assert episode(client, url)[1] > 0
    answer = client.post(f"{url}/monitor/close/")
    assert (answer.status_code, answer.json["code"]) == (400, "monitor_directory")
    assert "no space left" in answer.json["message"]
    assert start(client, url, resume=True) == 204


@pytest.mark.filterwarnings("ignore:.*Recording stopped")
def test_a_picture_that_fails_does_not_lose_the_step(app, client, faulty, monitor_dir, monkeypatch):
    url = faulty("Drawing", length=5)
    env = app._instances.get(url.rsplit("/", 1)[1]).gym_env.unwrapped
    start(client, url, video_callable=True)
    client.post(f"{url}/reset/")
    monkeypatch.setattr(env, "render", lambda: None)
    for _ in range(5):
        assert client.post(f"{url}/step/", json={"action": 0}).status_code == 200
    assert client.post(f"{url}/monitor/close/").json["code"] == "monitor_directory"
    # What was drawn before is kept.
    assert count_frames_and_secs(str(monitor_dir / "run" / "rl-video-episode-0.mp4"))[0] == 1
