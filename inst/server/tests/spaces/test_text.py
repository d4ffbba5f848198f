import pytest
from gymnasium.spaces import Text
from refusals import refused

from gym_server.spaces import decode, encode

SPACE = Text(3, min_length=1, charset="añ☃\U0001f600")


@pytest.mark.parametrize("value", ["a", "ñ☃\U0001f600"])
def test_a_text_stands_for_itself(value):
    assert decode(SPACE, value) == value
    assert encode(SPACE, value) == value


@pytest.mark.parametrize("value", ["", "aaaa", "b", "n\u0303", 5, None, ["a"], {}, True])
def test_what_is_no_member_is_refused(value):
    assert "Text(1, 3" in refused(SPACE, value)


def test_an_environment_that_observes_no_text_is_told():
    with pytest.raises(TypeError, match="not int"):
        encode(SPACE, 5)
