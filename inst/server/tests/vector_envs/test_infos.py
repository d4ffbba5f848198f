import numpy as np
import pytest

from gym_server.json_values import plain
from gym_server.vector_envs.infos import gather


def gathered(*infos):
    return plain(gather([None if info is None else (info, None) for info in infos], {}, len(infos)))


@pytest.mark.parametrize(
    ("values", "together"),
    [
        ((1, 2.5), [1.0, 2.5]),
        ((True, 3), [1, 3]),
        ((np.float32(0.5), 2), [0.5, 2.0]),
        ((1, None), [1, None]),
        ((1, "far"), [1, "far"]),
        ((2**70, 1), [2**70, 1]),
        ((np.arange(2), np.array([0.5, 1.5])), [[0.0, 1.0], [0.5, 1.5]]),
        ((np.arange(2), np.arange(3)), [[0, 1], [0, 1, 2]]),
        ((np.array(["a"]), np.array([1])), [["a"], [1]]),
        (({"at": 1}, 2), [{"at": 1}, 2]),
        ((2, {"at": 1}), [2, {"at": 1}]),
    ],
)
def test_values_of_different_types_stay_what_they_are(values, together):
    infos = gathered(*({"key": value} for value in values))
    assert infos["key"] == together
    assert infos["_key"] == [True, True]


def test_a_mask_tells_which_have_a_key():
    infos = gathered({"dead": 1.5}, None, {"alive": "yes"})
    assert infos == {
        "dead": [1.5, 0.0, 0.0],
        "_dead": [True, False, False],
        "alive": [None, None, "yes"],
        "_alive": [False, False, True],
    }


def test_a_dict_is_a_dict_again():
    infos = gathered({"episode": {"r": 1.0}}, {"episode": {"r": 2, "l": 3}})
    assert infos == {
        "episode": {"r": [1.0, 2.0], "_r": [True, True], "l": [0, 3], "_l": [False, True]},
        "_episode": [True, True],
    }
