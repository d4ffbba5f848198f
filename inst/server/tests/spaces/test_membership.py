import numpy as np
import pytest
from gymnasium.spaces import Box, Dict, Discrete

from gym_server import spaces
from gym_server.spaces import decode, describe

PENDULUM = Box(-2.0, 2.0, (1,), np.float32)


def contains(space, claim):
    return spaces.contains(
        space, claim, lambda value: decode(space, value), lambda: describe(space)
    )


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
    assert contains(PENDULUM, claim) is member


def test_bounds_that_a_client_rounded_to_15_digits_still_agree():
    space = Box(-4.8, 4.8, (1,), np.float32)
    assert contains(space, {"high": [4.80000019073486]})


def test_the_description_of_a_nested_space_is_compared_throughout():
    space = Dict(a=Box(0, 1, (2,)), b=Discrete(3))
    assert contains(space, {"spaces": describe(space)["spaces"]})
    other = describe(Dict(a=Box(0, 1, (2,)), b=Discrete(4)))["spaces"]
    assert not contains(space, {"spaces": other})
    assert contains(space, {"value": {"a": [0, 1], "b": 2}})
    assert not contains(space, {"value": {"a": [0, 1]}})
