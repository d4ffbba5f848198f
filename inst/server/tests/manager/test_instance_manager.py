import re
import threading
import time

import pytest


@pytest.fixture
def in_background(app):
    """POST from another thread; call the result for the response."""

    def in_background(url, body=None):
        answers = []
        thread = threading.Thread(
            target=lambda: answers.append(app.test_client().post(url, json=body))
        )
        thread.start()

        def answer():
            thread.join(20)
            return answers[0]

        return answer

    return in_background


def test_an_instance_id_is_8_hex_digits(create):
    assert re.fullmatch("/v1/envs/[0-9a-f]{8}", create())


def test_environments_are_listed_until_they_are_closed(client, create):
    first, second = create("CartPole-v0"), create("Pendulum-v1")
    ids = {url.rsplit("/", 1)[1]: url for url in (first, second)}
    assert set(client.get("/v1/envs/").json["all_envs"]) == set(ids)
    client.post(f"{first}/close/")
    assert client.get("/v1/envs/").json == {"all_envs": {second.rsplit("/", 1)[1]: "Pendulum-v1"}}


def test_an_env_id_that_is_listed_can_be_created_again(client, create, faulty):
    create("CartPole"), faulty("Counting")
    listed = client.get("/v1/envs/").json["all_envs"].values()
    assert sorted(listed) == ["CartPole-v1", "faulty_envs:Counting-v0"]


def test_a_closed_instance_is_unknown(client, create):
    url = create()
    client.post(f"{url}/close/")
    for answer in (client.post(f"{url}/close/"), client.post(f"{url}/reset/"), client.get(url)):
        assert answer.status_code == 400
        assert answer.json["message"] == f"Instance_id {url.rsplit('/', 1)[1]} unknown"


def test_who_waits_for_an_instance_that_closes_learns_that_it_is_gone(
    app, client, faulty, in_background
):
    url = faulty("Counting")
    client.post(f"{url}/reset/")
    instance = app._instances.get(url.rsplit("/", 1)[1])
    with instance.lock:
        waiting = in_background(f"{url}/step/", {"action": 0})
        time.sleep(0.2)
        instance.lock.closed = True
    assert waiting().json["message"] == f"Instance_id {instance.instance_id} unknown"
    assert instance.steps == 0


def test_steps_that_meet_a_close_are_taken_or_refused(client, faulty, in_background):
    url = faulty("Counting", seconds=0.05, length=1000)
    client.post(f"{url}/reset/")
    steps = [in_background(f"{url}/step/", {"action": 0}) for _ in range(8)]
    assert client.post(f"{url}/close/").status_code == 204
    for step in steps:
        answer = step()
        assert answer.status_code == 200 or answer.json["code"] == "unknown_instance"


def test_environments_do_not_wait_for_each_other(
    client, create, faulty, in_background, eventually, tmp_path
):
    meeting = tmp_path / "meeting"
    meeting.mkdir()
    slow, quick = faulty("Meeting", directory=str(meeting), count=2), create()
    client.post(f"{slow}/reset/")
    step = in_background(f"{slow}/step/", {"action": 0})
    eventually(lambda: list(meeting.iterdir()))
    assert client.post(f"{quick}/reset/").status_code == 200
    assert client.get("/v1/envs/").status_code == 200
    create()
    # If one of these had waited for the step, it would have given up by now.
    (meeting / "the test").touch()
    assert step().status_code == 200


def test_calls_of_one_environment_wait_for_each_other(client, faulty, in_background):
    url = faulty("Counting", length=100)
    client.post(f"{url}/reset/")
    steps = [in_background(f"{url}/step/", {"action": 0}) for _ in range(20)]
    seen = sorted(step().json["observation"][0] for step in steps)
    assert seen == list(range(1, 21))


@pytest.mark.parametrize(
    ("name", "kind"),
    [("CustomSpace", "OwnSpace"), ("LongDouble", "Box")],
)
def test_an_environment_whose_space_is_not_supported_is_refused_by_name(client, name, kind):
    answer = client.post("/v1/envs/", json={"env_id": f"faulty_envs:{name}-v0"})
    assert (answer.status_code, answer.json["code"]) == (400, "unsupported_space")
    assert kind in answer.json["message"]
    assert client.get("/v1/envs/").json == {"all_envs": {}}


def test_at_the_end_everything_is_closed_and_nothing_more_is_made(app, client, create):
    create(), create()
    app._instances.close_all()
    assert client.get("/v1/envs/").json == {"all_envs": {}}
    answer = client.post("/v1/envs/", json={"env_id": "CartPole-v1"})
    assert (answer.status_code, answer.json["code"]) == (503, "shutting_down")


def test_an_environment_that_fails_to_close_does_not_keep_the_others_open(app, faulty, create):
    faulty("RaisesInClose"), create()
    app._instances.close_all()


def test_instances_are_listed_with_who_uses_them_how_much(client, create):
    url = create("CartPole-v1", name="Änne's pole")
    sub_envs = create("CartPole-v1", num_envs=3)
    client.post(f"{sub_envs}/reset/")
    client.post(f"{sub_envs}/step/", json={"action": [0, 0, 0]})
    client.get(f"{sub_envs}/watch/presence/")
    first, second = client.get("/v1/instances/").json["instances"]
    assert first["age_seconds"] >= first.pop("idle_seconds") >= 0
    assert first.pop("age_seconds") >= second["age_seconds"]
    assert first == {
        "instance_id": url.rsplit("/", 1)[1],
        "env_id": "CartPole-v1",
        "name": "Änne's pole",
        "num_envs": None,
        "steps": 0,
        "watched": False,
    }
    expected = {"name": None, "num_envs": 3, "steps": 3, "watched": True}
    assert {key: second[key] for key in expected} == expected
    assert client.get(url).json["name"] == "Änne's pole"
    # Strictly typed classic clients know only this field.
    assert set(client.get("/v1/envs/").json) == {"all_envs"}


@pytest.mark.parametrize(
    "name", ["x" * 101, "two\nlines", "\x1b[31mred", "nul\0", "\u202eright to left", 7, ["a"]]
)
def test_a_name_is_a_short_text_on_one_line(client, name):
    refusal = client.post("/v1/envs/", json={"env_id": "CartPole-v1", "name": name})
    assert (refusal.status_code, refusal.json["code"]) == (400, "invalid_parameter")
    assert "1 to 100 printable characters" in refusal.json["message"]
