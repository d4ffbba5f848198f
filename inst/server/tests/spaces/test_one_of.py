import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete, OneOf
from refusals import refused

from gym_server.spaces import decode, encode

SPACE = OneOf([Discrete(2), Box(0, 1, (2,))])


def test_which_space_it_is_comes_first():
    index, member = decode(SPACE, [1, [0.5, 0.5]])
    assert type(index) is np.int64
    assert (index, member.tolist()) == (1, [0.5, 0.5])
    assert encode(SPACE, (index, member)) == [1, [0.5, 0.5]]
    assert decode(SPACE, [0.0, 1]) == (0, 1)


@pytest.mark.parametrize("index", [2, -1, 0.5, "0", None, True, [0]])
def test_an_index_of_no_space_is_refused(index):
    words = refused(SPACE, [index, 1])
    assert " at [0] is not in OneOf(" in words
    assert words.endswith("it has 2 spaces, from 0")


@pytest.mark.parametrize("value", [1, [], [0], [0, 1, 1], {}, None])
def test_what_is_no_pair_is_refused(value):
    assert refused(SPACE, value).endswith("a list of an index and a value is needed")


def test_a_wrong_member_is_named_by_its_place():
    assert refused(SPACE, [1, [0.5, "x"]]).startswith('"x" at [1][1] is not in Box(')
    assert refused(SPACE, [0, 2]) == "2 at [1] is not in Discrete(2)"
