import numpy as np
import pytest
from gymnasium.spaces import MultiBinary
from refusals import refused

from gym_server.spaces import decode, describe, encode


@pytest.mark.parametrize(("n", "shape"), [(3, [3]), ([2, 3], [2, 3])])
def test_its_shape_is_always_a_list(n, shape):
    expected = {"name": "MultiBinary", "dtype": "int8", "shape": shape}
    assert describe(MultiBinary(n)) == expected


def test_bits_are_0_1_and_booleans():
    member = decode(MultiBinary(4), [0, 1.0, True, False])
    assert member.dtype == np.int8
    assert member.tolist() == [0, 1, 1, 0]
    assert decode(MultiBinary(1), 1).tolist() == [1]


def test_an_environment_may_observe_booleans():
    assert encode(MultiBinary(2), np.array([True, False])) == [1, 0]


@pytest.mark.parametrize("value", [[0, 2], [0, -1], [0, 0.5], [0], [0, "1"], [0, None], 0, {}])
def test_what_is_no_member_is_refused(value):
    assert "MultiBinary(2)" in refused(MultiBinary(2), value)


def test_a_wrong_bit_is_named_with_its_place():
    assert refused(MultiBinary([2, 2]), [[0, 1], [7, 0]]).startswith("7 at [1][0] is not in")
