"""All registered environments: which run here, and why the others do not.

For tests: ``runnable()`` and ``not_runnable()`` are derived from the registry.
"""

import contextlib
import importlib
import os

import gymnasium
from gymnasium.envs.registration import EnvSpec

from gym_server.envs.extras import is_available

with contextlib.suppress(ImportError):
    importlib.import_module("ale_py")

# Set by ``make soak``: every environment, and each Atari game by all of its ids.
ALL = os.environ.get("GYM_TEST_ENVIRONMENTS") == "all"

# Tests register their own environments.
REGISTERED = [
    spec
    for spec in gymnasium.registry.values()
    if not isinstance(spec.entry_point, type)
    and not getattr(spec.entry_point, "__module__", "").startswith("faulty_envs.")
    and not spec.id.startswith("faulty")
]


def family(spec: EnvSpec) -> str:
    """Return the package of an environment, such as ``mujoco``."""
    if not isinstance(spec.entry_point, str):
        return "moved away"
    module = spec.entry_point.partition(":")[0].split(".")
    return module[2] if module[0] == "gymnasium" else module[0]


ATARI = {spec.id for spec in REGISTERED if family(spec) == "ale_py"}


def reason(spec: EnvSpec) -> str | None:
    """Return why an environment cannot run here, or None."""
    if not isinstance(spec.entry_point, str):
        if spec.name.startswith("GymV2"):
            return "may import any module that its env_id names; the server refuses it"
        return "MuJoCo v2 and v3 moved to gymnasium-robotics; Gymnasium keeps the name only"
    if spec.id == "Pusher-v4" and not is_available(spec):
        return "Gymnasium makes it with MuJoCo 2 only"
    return None if is_available(spec) else f"its extra is not installed ({family(spec)})"


def runnable() -> list[str]:
    """Return the ids that a server can make here."""
    return [spec.id for spec in REGISTERED if reason(spec) is None]


def atari_played() -> list[str]:
    """Return the ids of Atari games to play: every seventh game, with varying kinds of ids."""
    atari = [spec for spec in REGISTERED if spec.id in ATARI and reason(spec) is None]
    if ALL:
        return [spec.id for spec in atari]
    games: dict[str, list[str]] = {}
    for spec in atari:
        games.setdefault(spec.kwargs["game"], []).append(spec.id)
    return [ids[turn % len(ids)] for turn, ids in enumerate(list(games.values())[::7])]


def kind_of_id(env_id: str) -> str:
    """Return the part of an Atari id that is the same for all games, such as ``NoFrameskip-v4``."""
    name, _, version = env_id.rpartition("-")
    namespace, _, game = name.rpartition("/")
    return f"{namespace}{'NoFrameskip' if game.endswith('NoFrameskip') else ''}-{version}"


def older() -> set[str]:
    """Return the ids of environments that have a later version."""
    specs = [gymnasium.spec(env_id) for env_id in runnable()]
    latest: dict[str, int] = {}
    for spec in specs:
        latest[spec.name] = max(spec.version, latest.get(spec.name, 0))
    return {spec.id for spec in specs if spec.version < latest[spec.name]}


def not_runnable() -> dict[str, str]:
    """Return the ids of all other environments, with the reason."""
    return {spec.id: why for spec in REGISTERED if (why := reason(spec)) is not None}
