"""Read the actions that clients send, and add a hint when an environment rejects one."""

from __future__ import annotations

from gymnasium.spaces import Discrete, Space
from gymnasium.vector.utils import batch_space

from gym_server import spaces
from gym_server.errors import GymServerError

_CLIP = (
    "the action is outside the bounds of its Box; the wrapper ClipAction clips actions to them, "
    'in R by gym_wrap(..., "ClipAction")'
)


class ActionReader:
    """Reads the actions of one space, from JSON or tensors.

    As in Gymnasium, the bounds of a Box are left to the environment. All other requirements of the
    space are checked.
    """

    def __init__(self, space: Space, num_envs: int | None) -> None:
        """Create the readers.

        Args:
            space: the space of one action.
            num_envs: the number of sub-environments; None for a single environment.
        """
        self._space = space
        self._all = spaces.Rows(num_envs, f"the {num_envs} sub-environments")
        self._of_json = spaces.json_reader(space)
        self._of_tensors = spaces.tensor_reader(space, "action")

    def read(self, action: object, rows: int | None = None) -> object:
        """Decode an action, or with sub-environments a batch of actions.

        Args:
            action: a JSON value or ``Parts``.
            rows: how many sub-environments step; None for all, or for a single environment.

        Raises:
            GymServerError: ``action_not_in_space``.
        """
        whose = self._all if rows is None else self._rows(rows)
        try:
            if isinstance(action, spaces.Parts):
                return self._of_tensors(action, whose)
            if whose.number is None:
                return self._of_json(action)
            return spaces.decode_sub_envs(self._space, action, whose)
        except spaces.NotInSpace as refusal:
            raise GymServerError(
                "action_not_in_space", f"The action {refusal}", _possible_actions(self._space)
            ) from None

    def _rows(self, rows: int) -> spaces.Rows:
        if rows == self._all.number:
            return self._all
        return spaces.Rows(rows, f"the {rows} sub-environments that step")

    def explain(self, failure: GymServerError, action: object, rows: int | None = None) -> None:
        """Add a hint to an environment's error if the action was outside its Box.

        Args:
            failure: the error.
            action: the action as ``read()`` returned it.
            rows: as for ``read()``.
        """
        number = rows or self._all.number
        space = self._space if number is None else batch_space(self._space, number)
        if failure.code == "environment_error" and not space.contains(action):
            failure.hint = _CLIP


def _possible_actions(space: Space) -> str | None:
    """Describe the actions of a Discrete space, because users may count from 1."""
    if not isinstance(space, Discrete):
        return None
    first, last = int(space.start), int(space.start) + int(space.n) - 1
    if first == last:
        return f"the only action is {first}"
    counted = ", counted from 0" if first == 0 else ""
    return f"actions are {first} {'and' if space.n == 2 else 'to'} {last}{counted}"
