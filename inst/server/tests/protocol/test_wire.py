import json

import pytest
from refusals import code_of

from gym_server.api.exactly_once import RequestId
from gym_server.errors import GymServerError
from gym_server.protocol import wire
from gym_server.protocol.wire import Field


@pytest.mark.parametrize("raw", [b"", b"  ", b"null", b'""', b"[]", b" {} "])
def test_nothing_is_an_empty_object(raw):
    assert wire.loads(raw) == {}


@pytest.mark.parametrize(
    "raw", [b"{", b"env_id=CartPole-v1", b'{"a":NaN}', b"\xff\xfe", b"[" * 10**5]
)
def test_what_is_not_json_is_refused(raw):
    assert code_of(wire.loads, raw) == "malformed_json"


@pytest.mark.parametrize("raw", [b"1", b"true", b'"text"', b"[1]", b"1.5"])
def test_what_is_not_an_object_is_refused(raw):
    assert code_of(wire.loads, raw) == "not_an_object"


def test_json_out_is_strict():
    assert wire.dumps({"a": [float("nan"), 1.0]}) == b'{"a":["NaN",1.0]}'


def test_floats_keep_their_digits():
    assert json.loads(wire.dumps([0.1, 1 / 3])) == [0.1, 1 / 3]


def test_half_a_surrogate_pair_travels():
    assert json.loads(wire.dumps({"message": "\ud800"})) == {"message": "\ud800"}


@pytest.mark.parametrize("value", [5, 5.0, 0, 2**70])
def test_integer_valued_numbers_are_integers(value):
    result = wire.read({"seed": value}, [Field("seed", wire.INTEGER, "")])["seed"]
    assert result == value
    assert isinstance(result, int)


@pytest.mark.parametrize("value", [True, "5", -1, 1.5, float("inf"), [5], {}])
def test_what_is_no_seed_is_refused_and_named(value):
    with pytest.raises(GymServerError, match="'seed' must be an integer") as refusal:
        wire.read({"seed": value}, [Field("seed", wire.INTEGER, "")])
    assert refusal.value.code == "invalid_parameter"


@pytest.mark.parametrize("value", [None, "", []])
def test_empty_means_absent(value):
    assert wire.read({"seed": value}, [Field("seed", wire.INTEGER, "")]) == {"seed": None}
    required = [Field("env_id", wire.TEXT, "", required=True)]
    assert code_of(wire.read, {"env_id": value}, required) == "missing_parameter"


@pytest.mark.parametrize("value", [0, False, "", [], {}])
def test_an_action_is_missing_only_when_it_is_absent_or_null(value):
    action = [Field("action", wire.ANYTHING, "", required=True)]
    assert wire.read({"action": value}, action) == {"action": value}
    assert code_of(wire.read, {}, action) == "missing_parameter"
    assert code_of(wire.read, {"action": None}, action) == "missing_parameter"


@pytest.mark.parametrize("value", [0, 1, 0.0, 1.0])
def test_0_and_1_are_false_and_true(value):
    flag = [Field("force", wire.BOOLEAN, "")]
    assert wire.read({"force": value}, flag)["force"] is bool(value)


@pytest.mark.parametrize("value", [2, -1, 0.5, [1], {}, "1"])
def test_no_other_number_is_a_flag(value):
    flag = [Field("force", wire.BOOLEAN, "")]
    assert code_of(wire.read, {"force": value}, flag) == "invalid_parameter"


def test_booleans_may_be_words():
    flag = [Field("force", wire.BOOLEAN, "")]
    assert wire.read({"force": "true"}, flag) == {"force": True}
    assert wire.read({"force": "False"}, flag) == {"force": False}
    assert code_of(wire.read, {"force": "yes"}, flag) == "invalid_parameter"


@pytest.mark.parametrize(
    ("value", "every"), [(False, 0), (True, 1), ("true", 1), (10, 10), (10.0, 10), (0, 0)]
)
def test_video_callable_is_yes_no_or_every_nth(value, every):
    field = Field("video_callable", wire.VIDEO_CALLABLE, "")
    assert wire.read({"video_callable": value}, [field]) == {"video_callable": every}


@pytest.mark.parametrize(
    "value",
    [
        "key",
        {},
        {"key": "a"},
        {"key": "", "number": 1},
        {"key": "a" * 65, "number": 1},
        {"key": "a b", "number": 1},
        {"key": "a\r\nX: y", "number": 1},
        {"key": "a", "number": -1},
        {"key": "a", "number": "1"},
        {"key": 1, "number": 1},
    ],
)
def test_a_request_must_have_a_key_and_a_number(value):
    assert code_of(wire.read, {"request": value}, [wire.REQUEST]) == "invalid_parameter"


def test_answers_echo_the_request():
    request = RequestId("k", 3)
    assert json.loads(wire.answer({"a": 1}, request).body)["request"] == {"key": "k", "number": 3}
    assert wire.answer(None, request).headers == (("Gym-Request", "k 3"),)
    assert wire.answer({"a": 1}, None).body == b'{"a":1}'


def test_a_value_in_a_url_is_json_or_text():
    assert wire.parse_path_value("1") == 1
    assert wire.parse_path_value("[1, 2]") == [1, 2]
    assert wire.parse_path_value("NaN") == "NaN"
    assert wire.parse_path_value("left") == "left"


def test_what_can_be_read_can_be_written_however_deep():
    deepest = 0
    for depth in range(500, 1100):
        try:
            body = wire.loads(b'{"a":' * depth + b"1" + b"}" * depth)
        except GymServerError:
            continue
        deepest = depth

        def further_down(frames, body=body):
            return wire.dumps(body) if frames == 0 else further_down(frames - 1)

        assert further_down(20).startswith(b'{"a":')
    assert deepest > 500


@pytest.mark.parametrize("digits", [310, 4000])
@pytest.mark.parametrize("sign", ["", "-"])
@pytest.mark.parametrize(
    ("path", "fields"),
    [
        ("", '"env_id": "CartPole-v1", "seed": NUMBER'),
        ("", '"env_id": "CartPole-v1", "num_envs": 2, "seed": [NUMBER, 1]'),
        ("", '"env_id": "CartPole-v1", "num_envs": NUMBER'),
        ("", '"env_id": "CartPole-v1", "request": {"key": "a", "number": NUMBER}'),
        ("reset/", '"seed": NUMBER'),
        ("monitor/start/", '"directory": "run", "video_callable": NUMBER'),
    ],
)
def test_an_integer_that_is_larger_than_every_float_is_refused(
    client, create, path, fields, sign, digits
):
    body = "{" + fields.replace("NUMBER", f"{sign}1{'0' * (digits - 1)}") + "}"
    answer = client.post(f"{create()}/{path}" if path else "/v1/envs/", data=body)
    assert (answer.status_code, answer.json["code"]) == (400, "invalid_parameter")
    assert "with no number above 1e308, not" in answer.json["message"]


def test_the_largest_integers_that_are_floats_are_taken(client, create):
    assert client.post(f"{create()}/reset/", json={"seed": 10**308}).status_code == 200
