"""Environments that misbehave, or have spaces that the classic ones lack.

For tests: with ``--allow-module faulty_envs`` a server can make them, as in
``faulty_envs:Echo-v0``. The module needs only Gymnasium.
"""

import gymnasium

from faulty_envs.counting import Counting, KeepsItsArrays
from faulty_envs.drawing import Drawing, OldRenderModes
from faulty_envs.hanging import (
    Gated,
    Hanging,
    Meeting,
)
from faulty_envs.hoarding import Hoards, Large
from faulty_envs.odd_spaces import (
    SPACES,
    CustomSpace,
    Deep,
    Echo,
    Letters,
    LongDouble,
    Nested,
    NotANumber,
    Shifted,
)
from faulty_envs.raising import (
    ExitsInStep,
    ImportsInStep,
    RaisesElsewhere,
    RaisesInClose,
    RaisesInConstructor,
    RaisesInReset,
    RaisesInStep,
    Variables,
)
from faulty_envs.returning import Returning
from faulty_envs.rogue import Rogue
from faulty_envs.tables import LooksTimed, Table
from faulty_envs.uneven import CannotSaySo, Insists, KillsItself, SpoilsOneSubEnv, Uneven

__all__ = ["SPACES"]

for _kind in (
    Counting,
    CannotSaySo,
    CustomSpace,
    Deep,
    Drawing,
    Echo,
    ExitsInStep,
    Gated,
    Hanging,
    Hoards,
    Insists,
    KeepsItsArrays,
    KillsItself,
    Large,
    Letters,
    LongDouble,
    LooksTimed,
    Meeting,
    Nested,
    NotANumber,
    OldRenderModes,
    RaisesElsewhere,
    RaisesInClose,
    RaisesInConstructor,
    RaisesInReset,
    RaisesInStep,
    ImportsInStep,
    Returning,
    Rogue,
    Shifted,
    SpoilsOneSubEnv,
    Table,
    Uneven,
    Variables,
):
    gymnasium.register(id=f"{_kind.__name__}-v0", entry_point=_kind)
