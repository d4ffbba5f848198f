"""The package's extras: what environments need beyond the server's own dependencies."""

from __future__ import annotations

import contextlib
import functools
import importlib.metadata
import importlib.util
import re
import sys
from collections.abc import Callable

from gymnasium.envs.registration import EnvSpec

from gym_server.errors import GymServerError

# As in pyproject.toml.
REQUIREMENTS = {
    "toy-text": ("gymnasium[toy-text]",),
    "box2d": ("gymnasium[box2d]",),
    "mujoco": ("gymnasium[mujoco]",),
    "atari": ("gymnasium[atari]", "opencv-python-headless"),
    "video": ("moviepy",),
    "jax": ("gymnasium[jax]",),
}

# By the package of an environment: its extra, and the modules that must be installed. Toy text
# needs only the server's own dependencies.
_PACKAGES: dict[str, tuple[str, tuple[str, ...]]] = {
    "gymnasium.envs.box2d": ("box2d", ("Box2D",)),
    "gymnasium.envs.mujoco": ("mujoco", ("mujoco",)),
    "gymnasium.envs.phys2d": ("jax", ("jax", "flax")),
    "gymnasium.envs.tabular": ("jax", ("jax", "flax")),
    "ale_py": ("atari", ("ale_py",)),
}

# The distributions whose version decides what is played, by extra. Box2D has two.
_ENGINES = {
    "box2d": ("Box2D", "box2d-py"),
    "mujoco": ("mujoco",),
    "atari": ("ale-py",),
    "jax": ("jax",),
}

# Gymnasium refuses to make it with a later MuJoCo, whose results differ.
_BEFORE_MUJOCO_3 = ("Pusher-v4",)


def extra_of(spec: EnvSpec) -> str | None:
    """Return the extra that an environment needs, or None."""
    return _needs(spec)[0]


def is_available(spec: EnvSpec) -> bool:
    """Return whether an environment's requirements are installed, without importing them."""
    return why_unavailable(spec) is None


def lacks_extra(spec: EnvSpec) -> bool:
    """Return whether an extra would make an environment available."""
    return not all(map(_is_installed, _needs(spec)[1]))


def why_unavailable(spec: EnvSpec) -> str | None:
    """Return why an environment cannot be made here, or None, without importing anything."""
    maker = maker_of(spec)
    if not isinstance(maker, str):
        # For environments that moved to another package, Gymnasium registers a function that
        # raises.
        moved = maker is None or getattr(maker, "__name__", "").startswith("_raise")
        return "it is no longer part of Gymnasium" if moved else None
    if lacks_extra(spec):
        return f"it needs the server's extra '{extra_of(spec)}'"
    if spec.id in _BEFORE_MUJOCO_3 and _major_version("mujoco") >= 3:
        return "it needs a MuJoCo before version 3"
    package = maker.partition(":")[0].partition(".")[0]
    if _is_installed(package):
        return None
    return f"it needs the Python package '{package}', which no extra installs"


def maker_of(spec: EnvSpec) -> str | Callable | None:
    """Return what makes an environment, or its vector implementation if it has nothing else.

    A ``functools.partial`` has no name and no module, so its function is returned.
    """
    return unwrapped(spec.entry_point or spec.vector_entry_point)


def unwrapped(maker: str | Callable | None) -> str | Callable | None:
    """Return the function of a ``functools.partial``, and anything else as it is."""
    while isinstance(maker, functools.partial):
        maker = maker.func
    return maker


def engine_versions(spec: EnvSpec) -> dict[str, str]:
    """Return the versions of the packages, besides Gymnasium, that decide what is played."""
    maker = maker_of(spec)
    module = maker if isinstance(maker, str) else getattr(maker, "__module__", None) or ""
    # The name of a package of somebody else is mostly that of its module.
    names = _ENGINES.get(extra_of(spec) or "", (re.split("[.:]", module)[0],))
    versions = {}
    for name in names:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError, ValueError):
            versions[name] = importlib.metadata.version(name)
    versions.pop("gymnasium", None)
    return versions


def _major_version(package: str) -> int:
    return int(importlib.metadata.version(package).partition(".")[0])


def missing_extra(what: str, extra: str) -> GymServerError:
    """Report an extra of the server that is not installed."""
    return GymServerError(
        "missing_dependency",
        f"{what} needs the server's extra '{extra}'",
        how_to_install(extra),
        extra,
    )


def how_to_install(extra: str) -> str:
    """Return the command that installs an extra for this Python; uv's environments lack pip."""
    wanted = " ".join(f'"{requirement}"' for requirement in REQUIREMENTS[extra])
    if _is_installed("pip"):
        return f'in a terminal: "{sys.executable}" -m pip install {wanted}'
    return f'in a terminal: uv pip install --python "{sys.executable}" {wanted}'


def _needs(spec: EnvSpec) -> tuple[str | None, tuple[str, ...]]:
    maker = maker_of(spec)
    if isinstance(maker, str):
        for package, needs in _PACKAGES.items():
            if maker.startswith((f"{package}.", f"{package}:")):
                return needs
    return None, ()


def _is_installed(module: str) -> bool:
    # Look only for the top-level package: looking for submodules would import it.
    package = module.partition(".")[0]
    if package in sys.modules:
        return sys.modules[package] is not None
    return importlib.util.find_spec(package) is not None
