import pytest

from gym_server.protocol.safetensors import TENSORS, Tensor, write

CREATE = {"env_id": "CartPole-v1"}


def once(key, number, **fields):
    return {**fields, "request": {"key": key, "number": number}}


@pytest.mark.parametrize("body", [b"{", b"not json", b'{"env_id":NaN}'])
def test_a_body_that_is_not_json_is_400(client, body):
    answer = client.post("/v1/envs/", data=body)
    assert (answer.status_code, answer.json["code"]) == (400, "malformed_json")


@pytest.mark.parametrize("body", [b"[1]", b"3", b'"CartPole-v1"', b"true"])
def test_a_body_that_is_no_object_is_400(client, body):
    answer = client.post("/v1/envs/", data=body)
    assert (answer.status_code, answer.json["code"]) == (400, "not_an_object")


def test_an_enormous_body_is_413(client):
    answer = client.post("/v1/envs/", data=b" " * (16 * 2**20 + 1))
    assert (answer.status_code, answer.json["code"]) == (413, "body_too_large")


def test_json_may_have_a_mebibyte_and_tensors_more(client, create):
    body = b'{"env_id":"CartPole-v1"}'
    assert client.post("/v1/envs/", data=body.ljust(2**20)).status_code == 200
    refusal = client.post("/v1/envs/", data=body.ljust(2**20 + 1))
    assert (refusal.status_code, refusal.json["code"]) == (413, "body_too_large")
    assert "safetensors" in refusal.json["hint"]
    url = create()
    client.post(f"{url}/reset/")
    large = write({"action": Tensor("U8", (15 * 2**20,), bytes(15 * 2**20))}, {})
    step = client.post(f"{url}/step/", data=large, content_type=TENSORS)
    assert (step.status_code, step.json["code"]) == (400, "action_not_in_space")


def test_what_does_not_exist_is_404_in_json(client):
    answer = client.get("/v1/environments/")
    assert (answer.status_code, answer.json["code"]) == (404, "not_found")


@pytest.mark.parametrize(
    ("method", "url"), [("GET", "/v1/upload/"), ("DELETE", "/v1/envs/"), ("OPTIONS", "/v1/envs/")]
)
def test_another_method_is_405_in_json(client, method, url):
    answer = client.open(url, method=method)
    assert (answer.status_code, answer.json["code"]) == (405, "method_not_allowed")
    assert "POST" in answer.headers["Allow"]


def test_a_fault_of_our_own_is_500_in_json(client, app, monkeypatch, caplog):
    def fail():
        raise ZeroDivisionError("by us")

    monkeypatch.setattr(app._instances, "env_ids", fail)
    answer = client.get("/v1/envs/")
    assert (answer.status_code, answer.json["code"]) == (500, "internal_error")
    assert "ZeroDivisionError" in caplog.text


def test_half_a_surrogate_pair_in_an_id_is_answered(client):
    answer = client.post("/v1/envs/", data=b'{"env_id":"\\ud800"}')
    assert (answer.status_code, answer.json["code"]) == (400, "malformed_env_id")


def test_answers_are_json_by_type(client, create):
    url = create()
    for answer in (client.get("/v1/envs/"), client.post(f"{url}/reset/"), client.get("/nowhere")):
        assert answer.content_type == "application/json"


def test_a_numbered_create_makes_one_environment(client):
    answers = [client.post("/v1/envs/", json=once("a", 1, **CREATE)) for _ in range(3)]
    assert len({answer.data for answer in answers}) == 1
    assert answers[0].json["request"] == {"key": "a", "number": 1}
    assert len(client.get("/v1/envs/").json["all_envs"]) == 1


def test_a_created_environment_says_which_server_has_it(client):
    server = client.get("/v1/health/").json["server"]
    assert client.post("/v1/envs/", json=CREATE).json["server"] == server


def test_a_numbered_step_is_taken_once(client, faulty):
    url = faulty("Counting")
    client.post(f"{url}/reset/", json=once("a", 1))
    first = client.post(f"{url}/step/", json=once("a", 2, action=0))
    assert client.post(f"{url}/step/", json=once("a", 2, action=0)).data == first.data
    assert client.get(url).json["steps"] == 1
    assert client.post(f"{url}/step/", json=once("a", 3, action=0)).json["observation"] == [2]


def test_a_numbered_reset_is_done_once(client, create):
    url = create()
    first = client.post(f"{url}/reset/", json=once("a", 1))
    assert client.post(f"{url}/reset/", json=once("a", 1)).data == first.data


def test_a_numbered_close_is_answered_alike_each_time(client, create):
    url = create()
    for _ in range(2):
        answer = client.post(f"{url}/close/", json=once("a", 1))
        assert (answer.status_code, answer.data) == (204, b"")
        assert answer.headers["Gym-Request"] == "a 1"
    assert client.post(f"{url}/close/", json=once("a", 2)).json["code"] == "unknown_instance"


def test_errors_are_stored_and_echoed_too(client, faulty):
    url = faulty("RaisesInStep")
    client.post(f"{url}/reset/")
    answers = [client.post(f"{url}/step/", json=once("a", 1, action=1)) for _ in range(2)]
    assert answers[0].data == answers[1].data
    assert answers[0].status_code == answers[1].status_code == 500
    assert answers[0].json["request"] == {"key": "a", "number": 1}


def test_a_guessed_key_with_a_huge_number_blocks_nobody(client, faulty):
    url, other = faulty("Counting"), faulty("Counting")
    client.post(f"{url}/reset/", json=once("guessed", 1))
    client.post(f"{other}/reset/", json=once("guessed", 2**62))
    client.post("/v1/envs/", json=once("guessed", 2**62, **CREATE))
    client.post(f"{url}/step/", json=once("guessed", 2**62, action=9))
    assert client.post(f"{url}/step/", json=once("guessed", 2, action=0)).status_code == 200
    assert client.post("/v1/envs/", json=once("guessed", 3, **CREATE)).status_code == 200


@pytest.mark.parametrize("name", ["RaisesInStep", "ImportsInStep"])
def test_what_raised_inside_the_environment_is_not_done_again(client, faulty, name):
    url = faulty(name)
    client.post(f"{url}/reset/")
    answers = [client.post(f"{url}/step/", json=once("a", 1, action=1)) for _ in range(2)]
    assert answers[0].data == answers[1].data
    # The number is known: another action is a conflict.
    assert client.post(f"{url}/step/", json=once("a", 1, action=0)).status_code == 409


@pytest.mark.parametrize(
    ("route", "fields", "number"),
    [("step/", {"action": 1}, 2), ("reset/", {"action": 0}, 2), ("step/", {"action": 0}, 1)],
)
def test_a_number_used_for_something_else_is_409_and_nothing_is_done(
    client, faulty, route, fields, number
):
    url = faulty("Counting")
    client.post(f"{url}/reset/")
    client.post(f"{url}/step/", json=once("a", 2, action=0))
    answer = client.post(f"{url}/{route}", json=once("a", number, **fields))
    assert (answer.status_code, answer.json["code"]) == (409, "request_conflict")
    assert answer.json["request"]["number"] == number
    assert client.get(url).json["steps"] == 1


def test_without_a_number_every_request_counts(client, faulty):
    url = faulty("Counting")
    client.post(f"{url}/reset/")
    for expected in (1, 2):
        answer = client.post(f"{url}/step/", json={"action": 0, "request": None})
        assert answer.json["observation"] == [expected]


def test_a_request_that_is_none_is_refused(client):
    answer = client.post("/v1/envs/", json={**CREATE, "request": "1"})
    assert (answer.status_code, answer.json["code"]) == (400, "invalid_parameter")
    assert client.get("/v1/envs/").json == {"all_envs": {}}


def test_a_field_of_a_query_is_given_once(client, create):
    url = create()
    client.post(f"{url}/reset/", json={})
    for path in (
        f"{url}/watch/state/?sub_env=&sub_env=7",
        f"{url}/render/?sub_env=0&sub_env=0",
        "/v1/registry/?search=Cart&search=Pole",
    ):
        refusal = client.get(path)
        assert (refusal.status_code, refusal.json["code"]) == (400, "invalid_parameter")
    assert client.get(f"{url}/render/?sub_env=0&unknown=1&unknown=2").status_code == 200
