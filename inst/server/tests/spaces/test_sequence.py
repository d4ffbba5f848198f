import numpy as np
import pytest
from gymnasium.spaces import Box, Dict, Discrete, Sequence, Text
from refusals import refused

from gym_server.spaces import decode, encode


@pytest.mark.parametrize("value", [[], [1], [1, 0, 1]])
def test_any_number_of_members(value):
    space = Sequence(Discrete(2))
    assert decode(space, value) == tuple(value)
    assert encode(space, tuple(value)) == value


@pytest.mark.parametrize("value", [[], [[0.5, 1.0]], [[0.5, 1.0], [0.0, 0.25]]])
def test_a_stacked_one_is_an_array_with_the_members_first(value):
    space = Sequence(Box(0, 1, (2,), np.float32), stack=True)
    member = decode(space, value)
    assert (member.dtype, member.shape) == (np.float32, (len(value), 2))
    assert encode(space, member) == value


def test_a_stacked_one_of_dicts_is_a_dict_of_arrays():
    space = Sequence(Dict(x=Discrete(3), t=Text(2)), stack=True)
    value = [{"x": 2, "t": "a"}, {"x": 0, "t": "bb"}]
    member = decode(space, value)
    assert member["x"].tolist() == [2, 0]
    assert member["t"] == ("a", "bb")
    assert [dict(item) for item in encode(space, member)] == value


@pytest.mark.parametrize("stack", [False, True])
def test_what_gymnasium_samples_comes_back(stack):
    space = Sequence(Box(0, 1, (2,)), stack=stack, seed=1)
    for _ in range(20):
        member = space.sample()
        back = decode(space, encode(space, member))
        assert type(back) is type(member)
        assert np.array_equal(np.array(back), np.array(member))


@pytest.mark.parametrize("value", [1, None, {}, "01"])
def test_what_is_no_list_is_refused(value):
    assert refused(Sequence(Discrete(2)), value).endswith("a list is needed")


def test_a_wrong_member_is_named_by_its_index_from_0():
    for stack in (False, True):
        assert refused(Sequence(Discrete(2), stack=stack), [0, 5]).startswith("5 at [1] is not in")
