"""Ask for a refusal. For tests."""

import pytest

from gym_server.spaces import NotInSpace, decode


def refused(space, value):
    """Return the words with which a value is refused; fail when it is not."""
    with pytest.raises(NotInSpace) as refusal:
        decode(space, value)
    return str(refusal.value)
