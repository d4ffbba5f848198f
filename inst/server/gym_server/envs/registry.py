"""The environments that can be made: Gymnasium's registry, and what packages add to it."""

from __future__ import annotations

import contextlib
import difflib
import importlib
import logging
import threading
from collections.abc import Collection, Iterable

import gymnasium
from gymnasium import error
from gymnasium.envs import registration
from gymnasium.envs.registration import EnvSpec

from gym_server.envs.atari import classic_game
from gym_server.envs.extras import (
    extra_of,
    is_available,
    lacks_extra,
    maker_of,
    missing_extra,
    why_unavailable,
)
from gym_server.errors import GymServerError, invalid_parameter

log = logging.getLogger(__name__)

# The packages whose environments and arguments the server knows.
_KNOWN_PACKAGES = ("gymnasium", "ale_py")

# Held during imports. For circular imports, such as Gymnasium's, Python releases its import locks,
# and a second thread could use an incomplete module.
importing = threading.RLock()

# Longer ids are not looked up, because finding similar ids would take seconds.
LONGEST_ID = 200

# Packages that register a namespace. Since 1.0, Gymnasium does not import them.
_PACKAGES = {"ALE": "ale_py"}

# With shimmy installed, these make environments of older Gyms. Their argument env_id can import any
# module, even one that the operator has not allowed.
_UNGUARDED = ("GymV21Environment", "GymV26Environment")
_WHY_UNGUARDED = "may import any module that its env_id names, so this server makes none"


def look_up(name: str) -> EnvSpec:
    """Return the spec of an id; the newest version if the id names none.

    Raises:
        gymnasium.error.Error: the id is not registered.
        GymServerError: ``missing_dependency``, ``module_not_allowed``.
    """
    namespace, bare_name, _ = registration.parse_env_id(name)
    if bare_name in _UNGUARDED:
        raise GymServerError(
            "module_not_allowed",
            f"{name} {_WHY_UNGUARDED}",
        )
    with importing:
        try:
            return gymnasium.spec(_with_version(name))
        except (error.NameNotFound, error.NamespaceNotFound):
            _register_packages()
            _require_atari(name, namespace)
            return gymnasium.spec(_with_version(name))


def _require_atari(name: str, namespace: str | None) -> None:
    """Raise ``missing_dependency`` for an Atari game if the extra is missing."""
    if _PACKAGES["ALE"] in _registered:
        return
    if namespace == "ALE":
        raise missing_extra(name, "atari") from None
    if game := classic_game(name):
        raise missing_extra(f"{name}, today {game[0]},", "atari") from None


_registered: set[str] = set()


def _register_packages() -> None:
    """Import the packages that register environments, if they are installed."""
    for package in _PACKAGES.values():
        if package not in _registered:
            with contextlib.suppress(ImportError):
                importlib.import_module(package)
                _registered.add(package)


def _with_version(name: str) -> str:
    """Add the newest version to an id without one, as Gymnasium does."""
    namespace, bare_name, version = registration.parse_env_id(name)
    if version is None and name not in gymnasium.registry:
        version = registration.find_highest_version(namespace, bare_name)
    return registration.get_env_id(namespace, bare_name, version)


def near(name: str, limit: int = 3) -> list[str]:
    """Return the ids that are most similar to a name, most similar first.

    Leaves out ids that no extra of the server can make.
    """
    by_lower_case = {
        env_id.lower(): env_id
        for env_id, spec in gymnasium.registry.items()
        if is_available(spec) or lacks_extra(spec)
    }
    found = difflib.get_close_matches(name.lower(), by_lower_case, n=limit, cutoff=0.6)
    return [by_lower_case[match] for match in found]


def search(text: str | None, allowed_modules: Collection[str]) -> list[dict]:
    """Return the registered environments, one object each.

    Args:
        text: a part of the id, ignoring case; None for all. If no id contains it, the most similar
            ids are returned. Must not be longer than the longest id.
        allowed_modules: modules that the operator allowed; their environments are included.

    Raises:
        GymServerError: ``invalid_parameter``.
    """
    if text and len(text) > LONGEST_ID:
        raise invalid_parameter("search", text, f"of at most {LONGEST_ID} characters")
    with importing:
        _register_packages()
        import_allowed(allowed_modules)
        return [_entry(spec) for spec in _matching(text)]


def import_allowed(modules: Collection[str]) -> None:
    """Import modules for what they register; the caller holds ``importing``."""
    for module in modules:
        try:
            importlib.import_module(module)
        except BaseException as failure:
            log.warning("The allowed module %s cannot be imported: %s", module, failure)


def _matching(text: str | None) -> Iterable[EnvSpec]:
    specs = gymnasium.registry
    if not text:
        return specs.values()
    parts = [spec for env_id, spec in specs.items() if text.lower() in env_id.lower()]
    return parts or [specs[env_id] for env_id in near(text, limit=10)]


def _entry(spec: EnvSpec) -> dict:
    unguarded = spec.name in _UNGUARDED
    reason = f"it {_WHY_UNGUARDED}" if unguarded else why_unavailable(spec)
    return {
        "id": spec.id,
        "max_episode_steps": spec.max_episode_steps,
        "reward_threshold": spec.reward_threshold,
        "vectorised": spec.vector_entry_point is not None,
        "extra": extra_of(spec),
        "available": reason is None,
        "reason": reason,
    }


def module_of(spec: EnvSpec) -> str:
    """Return the module that makes an environment, or ""."""
    maker = maker_of(spec)
    if isinstance(maker, str):
        return maker.partition(":")[0]
    return getattr(maker, "__module__", None) or ""


def is_known(module: str) -> bool:
    """Return whether a module belongs to a package whose environments the server knows."""
    return module.partition(".")[0] in _KNOWN_PACKAGES
