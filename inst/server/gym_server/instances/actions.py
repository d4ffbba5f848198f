"""Read the actions that clients send, and add a hint where an environment refuses one."""

from __future__ import annotations

from gymnasium.spaces import Discrete, Space

from gym_server import spaces
from gym_server.errors import GymServerError

_CLIP = (
    "the action lies outside of the bounds of its Box; the wrapper ClipAction keeps actions "
    'inside, in R by gym_wrap(..., "ClipAction")'
)


class ActionReader:
    """Reads what is sent as an action of one space.

    The bounds of a Box are left to the environment, as in Gymnasium; everything else that makes a
    member of the space is checked.
    """

    def __init__(self, space: Space, num_envs: int | None) -> None:
        """Name the space.

        Args:
            space: of one action.
            num_envs: how many sub-environments there are; None for a single environment.
        """
        self._space = space
        self._all = spaces.Rows(num_envs, f"the {num_envs} sub-environments")
        self._taken = _Reader(spaces.with_wide_boxes(space))

    def read(self, action: object, rows: int | None = None) -> object:
        """Return the action, or with sub-environments the batch of actions, that was sent.

        Args:
            action: a JSON value or ``Parts``.
            rows: how many sub-environments step; None for all, or a single environment.

        Raises:
            GymServerError: ``action_not_in_space``.
        """
        try:
            return self._taken.read(action, self._all if rows is None else self._rows(rows))
        except spaces.NotInSpace as refusal:
            raise GymServerError(
                "action_not_in_space", f"The action {refusal}", _possible_actions(self._space)
            ) from None

    def explain(self, failure: GymServerError, action: object, rows: int | None = None) -> None:
        """Give an environment's own failure a hint, where the action was outside of a Box."""
        if failure.code != "environment_error":
            return
        try:
            _Reader(self._space).read(action, self._all if rows is None else self._rows(rows))
        except spaces.NotInSpace:
            failure.hint = _CLIP

    def _rows(self, rows: int | None) -> spaces.Rows:
        if rows == self._all.number:
            return self._all
        return spaces.Rows(rows, f"the {rows} sub-environments that step")


class _Reader:
    """What reads the actions of a space, made once for it."""

    def __init__(self, space: Space) -> None:
        self._space = space
        self._of_json = spaces.json_reader(space)
        self._of_tensors = spaces.tensor_reader(space, "action")

    def read(self, action: object, rows: spaces.Rows) -> object:
        if isinstance(action, spaces.Parts):
            return self._of_tensors(action, rows)
        if rows.number is None:
            return self._of_json(action)
        return spaces.decode_sub_envs(self._space, action, rows)


def _possible_actions(space: Space) -> str | None:
    """Return the actions of a Discrete space in words, as users may count from 1."""
    if not isinstance(space, Discrete):
        return None
    first, last = int(space.start), int(space.start) + int(space.n) - 1
    if first == last:
        return f"the only action is {first}"
    counted = ", counted from 0" if first == 0 else ""
    return f"actions are {first} {'and' if space.n == 2 else 'to'} {last}{counted}"
