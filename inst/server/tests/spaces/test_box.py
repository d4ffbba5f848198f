import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete
from refusals import refused

from gym_server.spaces import decode, describe, encode

PENDULUM = Box(-2.0, 2.0, (1,), np.float32)


def test_a_box_is_described_with_flat_bounds():
    info = describe(Box(np.array([[0, 1]]), np.array([[2, 3]]), dtype=np.uint8))
    assert info == {
        "name": "Box",
        "shape": [1, 2],
        "dtype": "uint8",
        "low": [0, 1],
        "high": [2, 3],
    }


def test_infinite_bounds_are_1e100_and_finite_ones_stay():
    info = describe(Box(np.array([-np.inf, -1e200]), np.array([np.inf, 1e200]), dtype=np.float64))
    assert info["low"] == [-1e100, -1e200]
    assert info["high"] == [1e100, 1e200]


def test_a_bare_number_is_a_box_action_of_shape_1():
    action = decode(PENDULUM, 0.5)
    assert action.shape == (1,)
    assert action.dtype == np.float32
    assert decode(PENDULUM, [0.5]) == action


def test_a_list_gets_the_boxs_dtype_and_shape():
    space = Box(0, 10, (2, 3), np.int16)
    nested = decode(space, [[1, 2, 3], [4, 5, 6]])
    assert nested.dtype == np.int16
    assert nested.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert decode(space, [1, 2, 3, 4, 5, 6.0]).tolist() == nested.tolist()


def test_a_box_without_dimensions_takes_a_number():
    assert decode(Box(0.0, 1.0, (), np.float64), 0.25).shape == ()


@pytest.mark.parametrize(
    "value",
    [
        [0.5, 0.5],
        [],
        [[0.5, 0.5]],
        [[[0.5]]],
        [True],
        True,
        "0.5",
        ["0.5"],
        None,
        [None],
        {},
        "NaN",
        "Infinity",
        1e39,
        2**2000,
    ],
)
def test_what_is_no_box_action_is_refused(value):
    assert refused(PENDULUM, value)


def test_ragged_lists_are_refused():
    assert refused(Box(0, 1, (2, 2)), [[0, 0], [0]])


def test_a_list_of_another_shape_is_refused():
    assert refused(Box(0, 1, (2, 3)), [[0, 0], [0, 0], [0, 0]])


def test_bounds_are_compared_in_the_boxs_own_dtype():
    space = Box(-0.1, 0.1, (1,), np.float32)
    assert decode(space, 0.1) == np.float32(0.1)
    assert decode(space, describe(space)["high"]) == np.float32(0.1)


def test_names_of_non_finite_numbers_are_numbers_and_the_bounds_decide():
    unbounded = Box(-np.inf, np.inf, (2,), np.float64)
    assert decode(unbounded, ["Infinity", "-Infinity"]).tolist() == [np.inf, -np.inf]
    assert refused(unbounded, ["NaN", 0])
    assert refused(Box(0, 5, (1,), np.int64), "Infinity")


def test_a_number_too_large_for_the_dtype_is_no_infinity():
    assert refused(Box(-np.inf, np.inf, (1,), np.float32), 1e39)
    assert refused(Box(-np.inf, np.inf, (1,), np.float64), 10**400)


@pytest.mark.parametrize("dtype", [np.uint8, np.int8, np.int64, np.uint64])
def test_integer_boxes_keep_every_digit_and_refuse_the_rest(dtype):
    limits = np.iinfo(dtype)
    space = Box(limits.min, limits.max, (1,), dtype)
    for value in (int(limits.min), int(limits.max)):
        assert decode(space, value).tolist() == [value]
    for value in (int(limits.min) - 1, int(limits.max) + 1, 0.5, 1e300):
        assert refused(space, value)


def test_a_boolean_box_takes_booleans_and_0_and_1():
    space = Box(0, 1, (3,), bool)
    assert decode(space, [True, 0, 1.0]).tolist() == [True, False, True]
    assert refused(space, [True, 2, 0])


def test_encoding_keeps_every_digit():
    value = np.array([0.1, 1 / 3], dtype=np.float32)
    assert encode(Box(0, 1, (2,)), value) == [float(value[0]), float(value[1])]
    assert encode(Box(0, 2**62, (1,), np.int64), np.array([2**62 - 1])) == [2**62 - 1]
    assert encode(Discrete(3), np.int64(2)) == 2


def test_the_element_that_does_not_fit_is_named_with_its_place():
    space = Box(-1, 1, (2, 3), np.float32)
    assert refused(space, [[0, 0, 0], [0, "NaN", 0]]).startswith('"NaN" at [1][1] is not in Box(')
    assert refused(space, [[0, 0, 0], [0, "x", 0]]).startswith('"x" at [1][1] is not in Box(')
    assert refused(space, [0, 0, 0, 0, "NaN", 0]).startswith('"NaN" at [4] is not in Box(')
    assert refused(space, [[0, 0, 0], [0, 1e39, 0]]).startswith("1e+39 at [1][1] is not in Box(")
    assert refused(PENDULUM, "NaN").startswith('"NaN" is not in Box(')


@pytest.mark.parametrize("shape", [(0,), (2, 0), (0, 2)])
def test_a_box_may_have_an_axis_of_length_zero(shape):
    space = Box(0, 1, shape, np.float32)
    assert describe(space)["low"] == []
    empty = np.zeros(shape, np.float32)
    assert decode(space, encode(space, empty)).shape == shape
