import pytest
from gymnasium.spaces import Discrete, Tuple
from refusals import refused

from gym_server.spaces import decode, encode

SPACE = Tuple([Discrete(2), Tuple([Discrete(3), Discrete(4)])])


def test_a_list_becomes_a_tuple_of_members():
    assert decode(SPACE, [1, [2, 3]]) == (1, (2, 3))
    assert encode(SPACE, (1, (2, 3))) == [1, [2, 3]]
    assert decode(Tuple([]), []) == ()


@pytest.mark.parametrize("value", [[1], [1, [2, 3], 4], {}, 1, None, "ab"])
def test_what_has_another_length_is_refused(value):
    assert refused(SPACE, value).endswith("a list of 2 is needed")


def test_a_part_is_named_by_its_index_from_0():
    assert refused(SPACE, [1, [2, 4]]) == "4 at [1][1] is not in Discrete(4)"


def test_an_observation_with_a_part_too_few_is_an_error():
    with pytest.raises(ValueError, match="zip"):
        encode(SPACE, (1,))
