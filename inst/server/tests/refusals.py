"""Check errors. For tests."""

import pytest

from gym_server.errors import GymServerError
from gym_server.spaces import NotInSpace, decode


def refused(space, value):
    """Return the message of the error for a value; fail if there is none."""
    with pytest.raises(NotInSpace) as refusal:
        decode(space, value)
    return str(refusal.value)


def code_of(call, *arguments):
    """Return the code of the error that a call raises; fail if there is none."""
    with pytest.raises(GymServerError) as refusal:
        call(*arguments)
    return refusal.value.code
