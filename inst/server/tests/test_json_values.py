import json
import math
from enum import IntEnum

import numpy as np
import pytest

from gym_server.json_values import brief, plain


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (None, None),
        (True, True),
        (np.bool_(False), False),
        (2**80, 2**80),
        (np.int64(-5), -5),
        (np.float32(0.5), 0.5),
        (math.nan, "NaN"),
        (np.float32(np.inf), "Infinity"),
        (-math.inf, "-Infinity"),
        (np.longdouble(0.25), 0.25),
        (np.array(7), 7),
        (np.array([[1.5, np.nan]]), [[1.5, "NaN"]]),
        (np.array([1, None, np.float32(2)], dtype=object), [1, None, 2.0]),
        (np.array({"a": np.int8(1)}, dtype=object), {"a": 1}),
        (np.str_("text"), "text"),
        ((1, {2}, range(2)), [1, [2], [0, 1]]),
        ({1: "a", (2, 3): "b", np.int64(4): "c"}, {"1": "a", "[2, 3]": "b", "4": "c"}),
        (b"raw", "b'raw'"),
        (1 + 2j, "(1+2j)"),
        (IntEnum("Colour", "RED").RED, 1),
    ],
)
def test_every_value_has_a_plain_form(value, expected):
    result = plain(value)
    assert result == expected
    assert type(result) is type(expected) or isinstance(result, (int, str))
    json.dumps(result, allow_nan=False)


def test_what_json_has_no_word_for_becomes_its_repr():
    assert plain(object) == "<class 'object'>"


def test_a_repr_that_fails_is_no_failure():
    class Shy:
        def __repr__(self):
            raise RuntimeError("no")

    assert plain({"shy": Shy()}) == {"shy": "<Shy>"}


def test_a_structure_that_contains_itself_ends():
    endless = {}
    endless["again"] = endless
    json.dumps(plain(endless))


def test_an_iterator_is_not_used_up():
    assert plain(iter([1])).startswith("<list_iterator")


def test_brief_is_json_and_short():
    assert brief(True) == "true"
    assert brief(math.nan) == '"NaN"'
    assert len(brief("x" * 1000)) == 80
    assert (
        brief({"a": [1, (2.5, None)], 3: np.arange(3)}) == '{"a": [1, [2.5, null]], "3": [0, 1, 2]}'
    )


def test_brief_is_short_whatever_the_value_is():
    assert brief({"a": list(range(1000))}).endswith("...")
    assert brief(10**5000) == "<class 'int'>"
    endless = []
    endless.append(endless)
    assert brief(endless) == "[" * 77 + "..."
