import numpy as np
import pytest
from gymnasium.spaces import MultiDiscrete
from refusals import refused

from gym_server.spaces import Rows, decode, decode_sub_envs, describe

SPACE = MultiDiscrete([[2, 3], [4, 5]], dtype=np.int32, start=[[0, -1], [0, 10]])


def test_it_is_described_flat():
    assert describe(SPACE) == {
        "name": "MultiDiscrete",
        "dtype": "int32",
        "shape": [2, 2],
        "nvec": [2, 3, 4, 5],
        "start": [0, -1, 0, 10],
    }


def test_a_list_gets_its_dtype_and_shape():
    for value in ([[1, 1.0], [3, 14]], [1, 1, 3, 14]):
        member = decode(SPACE, value)
        assert member.dtype == np.int32
        assert member.tolist() == [[1, 1], [3, 14]]


def test_true_and_false_are_1_and_0_as_for_discrete():
    space = MultiDiscrete([2, 2], dtype=np.uint8)
    assert decode(space, [True, False]).tolist() == [1, 0]
    sub_envs = [[True, False], [0, True]]
    assert decode_sub_envs(space, sub_envs, Rows(2, "")).tolist() == [[1, 0], [0, 1]]
    assert refused(space, [-1, True]).startswith("-1 at [0]")


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ([[0, 0], [0, 9]], "9 at [1][1] is not in MultiDiscrete"),
        ([[0, 2], [0, 10]], "2 at [0][1] is not in MultiDiscrete"),
        ([0, 0, 4, 10], "4 at [2] is not in MultiDiscrete"),
        ([[0, 0.5], [0, 10]], "0.5 at [0][1] is not in MultiDiscrete"),
        ([[0, 1], [0, True]], "1 at [1][1] is not in MultiDiscrete"),
        ([[0, 0], [0, 2**40]], "1099511627776 at [1][1] is not in MultiDiscrete"),
        ([0, 0, 0], "[0, 0, 0] is not in MultiDiscrete"),
        (0, "0 is not in MultiDiscrete"),
        ("NaN", '"NaN" is not in MultiDiscrete'),
        ({}, "{} is not in MultiDiscrete"),
    ],
)
def test_what_is_no_member_is_refused_with_its_place(value, words):
    assert refused(SPACE, value).startswith(words)


def test_the_largest_value_may_be_that_of_the_dtype():
    space = MultiDiscrete([2], dtype=np.int8, start=[126])
    assert decode(space, [127]).tolist() == [127]
