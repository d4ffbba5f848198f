import numpy as np
import pytest
from gymnasium.spaces import Dict, Discrete, Tuple
from refusals import refused

from gym_server.spaces import Rows, decode, decode_sub_envs, describe


def test_a_discrete_space_is_described():
    assert describe(Discrete(2)) == {"name": "Discrete", "n": 2, "start": 0, "dtype": "int64"}
    assert describe(Discrete(3, start=-1))["start"] == -1


@pytest.mark.parametrize("value", [1, 1.0])
def test_1_and_1_0_are_the_discrete_action_1(value):
    action = decode(Discrete(2), value)
    assert action == 1
    assert action.dtype == np.int64


def test_a_discrete_space_may_begin_elsewhere():
    space = Discrete(3, start=-1)
    assert decode(space, -1) == -1
    assert refused(space, 2)


def test_true_and_false_are_1_and_0():
    for value, number in ((True, 1), (False, 0)):
        action = decode(Discrete(2), value)
        assert action == number
        assert action.dtype == np.int64
    assert decode(Discrete(3, start=-1), False) == 0
    assert refused(Discrete(3, start=1), False).startswith("false is not in Discrete")
    assert decode(Tuple([Discrete(2)]), [True]) == (1,)
    assert decode_sub_envs(Discrete(2), [True, False, 1], Rows(3, "")).tolist() == [1, 0, 1]
    assert decode_sub_envs(Dict(a=Discrete(2)), [{"a": True}, {"a": 0}], Rows(2, ""))[
        "a"
    ].tolist() == [
        1,
        0,
    ]


@pytest.mark.parametrize(
    "value", [2, -1, 0.5, "1", None, [1], {}, "NaN", float("nan"), float("inf"), 1e300, 2**70]
)
def test_what_is_no_discrete_action_is_refused(value):
    assert refused(Discrete(2), value)
