import pytest
from refusals import code_of

from gym_server.api import fields
from gym_server.protocol import wire
from gym_server.protocol.wire import Field


@pytest.mark.parametrize("value", [[], [1], ["true"], [[True]], [None], True, "true", {}])
def test_what_is_no_mask_is_refused(value):
    assert code_of(wire.read, {"m": value}, [Field("m", fields.MASK, "")]) == "invalid_parameter"


def test_seeds_may_be_one_a_sub_env():
    seed = [Field("seed", fields.SEED, "")]
    assert wire.read({"seed": [1, None, 3.0]}, seed) == {"seed": (1, None, 3)}
    assert wire.read({"seed": 3.0}, seed) == {"seed": 3}
    for value in (-1, "5", [1, -1], [[1]]):
        assert code_of(wire.read, {"seed": value}, seed) == "invalid_parameter"


def test_true_and_false_are_the_seeds_1_and_0():
    seed = [Field("seed", fields.SEED, "")]
    for value, number in ((True, 1), (False, 0), ([False, None, True], (0, None, 1))):
        read = wire.read({"seed": value}, seed)["seed"]
        assert read == number
        assert repr(read) == repr(number)
