import json

import numpy as np
import pytest
from gymnasium.spaces import Box, Dict, Discrete, Tuple

from gym_server import spaces
from gym_server.errors import GymServerError
from gym_server.spaces import NotInSpace, decode, describe, encode

PENDULUM = Box(-2.0, 2.0, (1,), np.float32)


def refused(space, value):
    with pytest.raises(NotInSpace):
        decode(space, value)
    return True


def test_a_discrete_space_is_described():
    assert describe(Discrete(2)) == {"name": "Discrete", "n": 2, "start": 0, "dtype": "int64"}
    assert describe(Discrete(3, start=-1))["start"] == -1


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


def test_descriptions_are_json():
    for space in (Discrete(4), PENDULUM, Box(0, 1, (2, 2), bool)):
        json.dumps(describe(space), allow_nan=False)


@pytest.mark.parametrize(
    ("space", "name"),
    [
        (Dict(a=Discrete(2)), "Dict"),
        (Tuple([Discrete(2)]), "Tuple"),
        (Box(0, 1, (1,), np.longdouble), "longdouble|float128|float96"),
    ],
)
def test_an_unsupported_space_is_named(space, name):
    with pytest.raises(GymServerError, match=name) as refusal:
        describe(space)
    assert refusal.value.code == "unsupported_space"


@pytest.mark.parametrize("value", [1, 1.0])
def test_1_and_1_0_are_the_discrete_action_1(value):
    action = decode(Discrete(2), value)
    assert action == 1
    assert action.dtype == np.int64


def test_a_discrete_space_may_begin_elsewhere():
    space = Discrete(3, start=-1)
    assert decode(space, -1) == -1
    assert refused(space, 2)


@pytest.mark.parametrize(
    "value", [2, -1, 0.5, True, "1", None, [1], {}, "NaN", float("nan"), float("inf"), 1e300, 2**70]
)
def test_what_is_no_discrete_action_is_refused(value):
    assert refused(Discrete(2), value)


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
        2.1,
        -2.1,
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


def test_what_is_encoded_decodes_to_itself():
    for space in (Discrete(5, start=-2), PENDULUM, Box(0, 255, (2, 2), np.uint8)):
        space.seed(0)
        for _ in range(20):
            member = space.sample()
            wire = json.loads(json.dumps(encode(space, member)))
            assert np.array_equal(decode(space, wire), member)


@pytest.mark.parametrize(
    ("claim", "member"),
    [
        ({"value": [0.5]}, True),
        ({"value": 3}, False),
        ({"value": None}, False),
        ({}, True),
        ({"name": "Box"}, True),
        ({"name": "Box", "shape": [1]}, True),
        ({"shape": 1}, True),
        ({"shape": [1.0]}, True),
        ({"shape": [True]}, False),
        ({"low": [-2]}, True),
        ({"low": [-2.00000000000000001]}, True),
        ({"high": [2.5]}, False),
        ({"name": "Discrete"}, False),
        ({"n": 2}, False),
        ({"shape": [1, 1]}, False),
    ],
)
def test_contains_is_asked_by_value_or_by_description(claim, member):
    assert spaces.contains(PENDULUM, describe(PENDULUM), claim) is member


def test_bounds_that_a_client_rounded_to_15_digits_still_agree():
    space = Box(-4.8, 4.8, (1,), np.float32)
    assert spaces.contains(space, describe(space), {"high": [4.80000019073486]})


def test_a_refusal_names_space_and_value_briefly():
    with pytest.raises(NotInSpace, match=r'^"left" is not in Discrete\(2\)$'):
        decode(Discrete(2), "left")
    with pytest.raises(NotInSpace) as refusal:
        decode(Box(np.arange(500.0), np.arange(500.0), dtype=np.float64), [1.5] * 1000)
    assert len(str(refusal.value)) < 250
