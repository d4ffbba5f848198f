import pytest
from gymnasium.spaces import Dict, Discrete
from refusals import refused

from gym_server.spaces import decode, describe, encode

SPACE = Dict([("b", Discrete(2)), ("a", Dict(x=Discrete(3)))])


def test_the_order_is_the_spaces_own():
    assert [part["key"] for part in describe(SPACE)["spaces"]] == ["b", "a"]
    assert list(decode(SPACE, {"a": {"x": 2}, "b": 1})) == ["b", "a"]
    assert list(encode(SPACE, {"a": {"x": 2}, "b": 1})) == ["b", "a"]


def test_keys_that_are_no_texts_are_texts_on_the_wire():
    space = Dict([(1, Discrete(2))])
    assert encode(space, {1: 1}) == {"1": 1}
    assert decode(space, {"1": 1}) == {1: 1}


def test_an_empty_one_is_also_rs_empty_list():
    assert decode(Dict(), []) == decode(Dict(), {}) == {}


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        ({"b": 1}, '"a" is missing'),
        ({"z": 1, "y": 2, "x": 3}, '"b" is missing'),
        ({"a": {"x": 1}, "b": 1, "f": 2, "e": 2, "d": 2}, '"f" is not one of its keys'),
        ({"a": {"x": 1}, "b": 1, "c": 2}, '"c" is not one of its keys'),
        ([1, 2], "an object is needed"),
        ([], "an object is needed"),
        (1, "an object is needed"),
    ],
)
def test_other_keys_are_refused(value, reason):
    assert refused(SPACE, value).endswith(reason)


def test_a_part_is_named_by_its_key():
    assert refused(SPACE, {"a": {"x": 3}, "b": 1}) == "3 at $a$x is not in Discrete(3)"
