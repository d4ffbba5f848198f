import pytest
from refusals import code_of

from gym_server.errors import GymServerError
from gym_server.protocol.fields import ANYTHING, BOOLEAN, REQUEST, TEXT, Field, Kind, integer, read

INTEGER = Kind("an integer, 0 or greater", integer)


@pytest.mark.parametrize("value", [5, 5.0, 0, 2**70])
def test_integer_valued_numbers_are_integers(value):
    result = read({"seed": value}, [Field("seed", INTEGER)])["seed"]
    assert result == value
    assert isinstance(result, int)


@pytest.mark.parametrize("value", [True, "5", -1, 1.5, float("inf"), [5], {}])
def test_what_is_no_seed_is_refused_and_named(value):
    with pytest.raises(GymServerError, match="'seed' must be an integer") as refusal:
        read({"seed": value}, [Field("seed", INTEGER)])
    assert refusal.value.code == "invalid_parameter"


@pytest.mark.parametrize("value", [None, "", []])
def test_empty_means_absent(value):
    assert read({"seed": value}, [Field("seed", INTEGER)]) == {"seed": None}
    required = [Field("env_id", TEXT, required=True)]
    assert code_of(read, {"env_id": value}, required) == "missing_parameter"


@pytest.mark.parametrize("value", [0, False, "", [], {}])
def test_an_action_is_missing_only_when_it_is_absent_or_null(value):
    action = [Field("action", ANYTHING, required=True)]
    assert read({"action": value}, action) == {"action": value}
    assert code_of(read, {}, action) == "missing_parameter"
    assert code_of(read, {"action": None}, action) == "missing_parameter"


@pytest.mark.parametrize("value", [0, 1, 0.0, 1.0])
def test_0_and_1_are_false_and_true(value):
    flag = [Field("force", BOOLEAN)]
    assert read({"force": value}, flag)["force"] is bool(value)


@pytest.mark.parametrize("value", [2, -1, 0.5, [1], {}, "1"])
def test_no_other_number_is_a_flag(value):
    flag = [Field("force", BOOLEAN)]
    assert code_of(read, {"force": value}, flag) == "invalid_parameter"


def test_booleans_may_be_words():
    flag = [Field("force", BOOLEAN)]
    assert read({"force": "true"}, flag) == {"force": True}
    assert read({"force": "False"}, flag) == {"force": False}
    assert code_of(read, {"force": "yes"}, flag) == "invalid_parameter"


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
    assert code_of(read, {"request": value}, [REQUEST]) == "invalid_parameter"


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
