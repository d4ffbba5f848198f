import pytest
from refusals import code_of

from gym_server.api import env_fields
from gym_server.protocol.fields import Field, read


@pytest.mark.parametrize("value", [[], [1], ["true"], [[True]], [None], True, "true", {}])
def test_what_is_no_mask_is_refused(value):
    assert code_of(read, {"m": value}, [Field("m", env_fields.MASK)]) == "invalid_parameter"


def test_seeds_may_be_one_a_sub_env():
    seed = [Field("seed", env_fields.SEED)]
    assert read({"seed": [1, None, 3.0]}, seed) == {"seed": (1, None, 3)}
    assert read({"seed": 3.0}, seed) == {"seed": 3}
    for value in (-1, "5", [1, -1], [[1]]):
        assert code_of(read, {"seed": value}, seed) == "invalid_parameter"


def test_true_and_false_are_the_seeds_1_and_0():
    seed = [Field("seed", env_fields.SEED)]
    for value, number in ((True, 1), (False, 0), ([False, None, True], (0, None, 1))):
        found = read({"seed": value}, seed)["seed"]
        assert found == number
        assert repr(found) == repr(number)


@pytest.mark.parametrize(
    ("value", "every"), [(False, 0), (True, 1), ("true", 1), (10, 10), (10.0, 10), (0, 0)]
)
def test_video_callable_is_yes_no_or_every_nth(value, every):
    field = Field("video_callable", env_fields.VIDEO_CALLABLE)
    assert read({"video_callable": value}, [field]) == {"video_callable": every}
