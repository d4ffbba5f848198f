import pytest
from refusals import code_of

from gym_server.errors import GymServerError
from gym_server.protocol.answers import dumps
from gym_server.protocol.bodies import loads, parse_path_value

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("raw", [b"", b"  ", b"null", b'""', b"[]", b" {} "])
def test_nothing_is_an_empty_object(raw):
    assert loads(raw) == {}


@pytest.mark.parametrize(
    "raw", [b"{", b"env_id=CartPole-v1", b'{"a":NaN}', b"\xff\xfe", b"[" * 10**5]
)
def test_what_is_not_json_is_refused(raw):
    assert code_of(loads, raw) == "malformed_json"


def test_json_is_only_so_long():
    assert loads(b"{}" + b" " * (2**20 - 2)) == {}
    assert code_of(loads, b"{}" + b" " * (2**20 - 1)) == "body_too_large"


@pytest.mark.parametrize("raw", [b"1", b"true", b'"text"', b"[1]", b"1.5"])
def test_what_is_not_an_object_is_refused(raw):
    assert code_of(loads, raw) == "not_an_object"


def test_a_value_in_a_url_is_json_or_text():
    assert parse_path_value("1") == 1
    assert parse_path_value("[1, 2]") == [1, 2]
    assert parse_path_value("NaN") == "NaN"
    assert parse_path_value("left") == "left"


def test_what_can_be_read_can_be_written_however_deep():
    deepest = 0
    for depth in range(500, 1100):
        try:
            body = loads(b'{"a":' * depth + b"1" + b"}" * depth)
        except GymServerError:
            continue
        deepest = depth

        def further_down(frames, body=body):
            return dumps(body) if frames == 0 else further_down(frames - 1)

        assert further_down(20).startswith(b'{"a":')
    assert deepest > 500
