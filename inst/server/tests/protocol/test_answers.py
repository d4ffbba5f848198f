import json

from gym_server.protocol import answers
from gym_server.protocol.answers import dumps, response_to
from gym_server.protocol.fields import RequestId


def test_json_out_is_strict():
    assert dumps({"a": [float("nan"), 1.0]}) == b'{"a":["NaN",1.0]}'


def test_floats_keep_their_digits():
    assert json.loads(dumps([0.1, 1 / 3])) == [0.1, 1 / 3]


def test_what_is_long_is_written_in_pieces(monkeypatch):
    longest = 0

    def watched(value):
        nonlocal longest
        longest = max(longest, answers._size(value))
        return encode(value)

    encode = answers._encode
    monkeypatch.setattr(answers, "_encode", watched)
    for value in (
        {"model": {"state": list(range(50_000)), 3: [0.5] * 30_000}, "a": [], "b": {}},
        [[[row, column, "é"] for column in range(300)] for row in range(100)],
        [[list(range(90_000))]],
        {"observation": [{"a": [1]}] * 60_000, "info": {"x": None}},
    ):
        assert dumps(value) == encode(value).encode()
    assert 0 < longest <= answers._AT_ONCE


def test_half_a_surrogate_pair_travels():
    assert json.loads(dumps({"message": "\ud800"})) == {"message": "\ud800"}


def test_answers_echo_the_request():
    request = RequestId("k", 3)
    assert json.loads(response_to({"a": 1}, request).body)["request"] == {"key": "k", "number": 3}
    assert response_to(None, request).headers == (("Gym-Request", "k 3"),)
    assert response_to({"a": 1}, None).body == b'{"a":1}'
