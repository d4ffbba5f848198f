"""Ask for a refusal. For tests."""

import pytest

from gym_server.errors import GymServerError
from gym_server.spaces import NotInSpace, decode


def refused(space, value):
    """Return the words with which a value is refused; fail when it is not."""
    with pytest.raises(NotInSpace) as refusal:
        decode(space, value)
    return str(refusal.value)


def code_of(call, *arguments):
    """Return the code of the error that a call raises; fail when it raises none."""
    with pytest.raises(GymServerError) as refusal:
        call(*arguments)
    return refusal.value.code
