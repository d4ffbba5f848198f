import json

from gym_server.protocol.answers import dumps, response_to
from gym_server.protocol.fields import RequestId


def test_json_out_is_strict():
    assert dumps({"a": [float("nan"), 1.0]}) == b'{"a":["NaN",1.0]}'


def test_floats_keep_their_digits():
    assert json.loads(dumps([0.1, 1 / 3])) == [0.1, 1 / 3]


def test_half_a_surrogate_pair_travels():
    assert json.loads(dumps({"message": "\ud800"})) == {"message": "\ud800"}


def test_answers_echo_the_request():
    request = RequestId("k", 3)
    assert json.loads(response_to({"a": 1}, request).body)["request"] == {"key": "k", "number": 3}
    assert response_to(None, request).headers == (("Gym-Request", "k 3"),)
    assert response_to({"a": 1}, None).body == b'{"a":1}'
