import json

import numpy as np
import pytest

from gym_server.errors import GymServerError
from gym_server.protocol import bodies, known_headers


def body(number, key="k", data=None, dtype="I32", spaces=0, first=True, **metadata):
    """Return a client's body, with the metadata before or after the tensor."""
    data = np.arange(4, dtype="<i4").tobytes() if data is None else data
    request = f'{{"key":{json.dumps(key)},"number":{number}}}'
    about = {"__metadata__": {"request": request, **metadata}}
    shape = [len(data) // {"I32": 4, "BOOL": 1}[dtype]]
    tensor = {"action": {"dtype": dtype, "shape": shape, "data_offsets": [0, len(data)]}}
    header = {**about, **tensor} if first else {**tensor, **about}
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8 + spaces)
    return len(text).to_bytes(8, "little") + text + data


@pytest.fixture
def parsed(monkeypatch):
    """Return the bodies that were parsed, in a thread that knows no header yet."""
    monkeypatch.setattr(known_headers, "_memory", known_headers._Memory())
    parsed, parse = [], bodies.parse_tensors
    monkeypatch.setattr(
        known_headers, "parse_tensors", lambda raw: parsed.append(raw) or parse(raw)
    )
    return parsed


@pytest.mark.parametrize("first", [True, False])
def test_a_header_that_comes_again_is_not_parsed_again(parsed, first):
    for number in range(10, 100):
        raw = body(number, data=np.arange(number, number + 4, dtype="<i4").tobytes(), first=first)
        read = known_headers.loads_tensors(raw)
        assert read["request"] == {"key": "k", "number": number}
        assert read["action"].tensors["action"].array().tolist() == [*range(number, number + 4)]
    # The first two, and the second again with another number.
    assert len(parsed) == 3


@pytest.mark.parametrize(
    "other",
    [
        body(12, key="l"),
        body(12, info="false"),
        body(12, spaces=8),
        body(12, data=bytes(12)),
        body(12, data=bytes(16), dtype="BOOL"),
        body("12.0"),
        body("012"),
        body("1 2"),
        body("-1"),
        body(""),
        body("1e1"),
        body("9" * 20),
        body("12", step_mask="[true]"),
        body(12)[:-1],
        body(12) + b"\0",
        body(12)[:8] + b"[" + body(12)[9:],
        body(12).replace(b"]}}", b"]]}"),
        b"",
    ],
)
def test_what_differs_is_read_as_if_nothing_were_known(parsed, other):
    def outcome(read):
        try:
            return read(other)
        except GymServerError as refusal:
            return refusal.code, refusal.message

    fresh = outcome(bodies.parse_tensors)
    for number in (10, 11, 12):
        known_headers.loads_tensors(body(number))
    parsed.clear()
    assert outcome(known_headers.loads_tensors) == fresh
    assert parsed


def test_booleans_are_checked_each_time(parsed):
    for number in (10, 11, 12):
        known_headers.loads_tensors(body(number, data=bytes(16), dtype="BOOL"))
    with pytest.raises(GymServerError, match="neither 0 nor 1"):
        known_headers.loads_tensors(body(13, data=b"\2" * 16, dtype="BOOL"))


def test_a_number_that_stands_elsewhere_is_not_taken_for_the_requests(parsed):
    for number in (10, 11, 12, 13):
        raw = body("5 ", unknown=f'{{"number":{number}}}')
        assert known_headers.loads_tensors(raw)["request"]["number"] == 5
