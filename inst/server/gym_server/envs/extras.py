"""The package's extras: what environments need beyond the server's own dependencies."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import sys

from gymnasium.envs.registration import EnvSpec

from gym_server.errors import GymServerError

# As in pyproject.toml.
REQUIREMENTS = {
    "toy-text": ("gymnasium[toy-text]",),
    "box2d": ("gymnasium[box2d]",),
    "mujoco": ("gymnasium[mujoco]",),
    "atari": ("gymnasium[atari]", "opencv-python-headless"),
    "video": ("moviepy",),
}

# By the package of an environment: its extra, and the module that must be installed. Toy text needs
# only the server's own dependencies.
_PACKAGES = {
    "gymnasium.envs.box2d": ("box2d", "Box2D"),
    "gymnasium.envs.mujoco": ("mujoco", "mujoco"),
    "gymnasium.envs.phys2d": (None, "jax"),
    "gymnasium.envs.tabular": (None, "jax"),
    "ale_py": ("atari", "ale_py"),
}

# Gymnasium refuses to make it with a later MuJoCo, whose results differ.
_BEFORE_MUJOCO_3 = ("Pusher-v4",)


def extra_of(spec: EnvSpec) -> str | None:
    """Return the extra that an environment needs, or None."""
    return _needs(spec)[0]


def is_available(spec: EnvSpec) -> bool:
    """Return whether an environment's requirements are installed, without importing them."""
    return why_unavailable(spec) is None


def why_unavailable(spec: EnvSpec) -> str | None:
    """Return why an environment cannot be made here, or None, without importing anything."""
    if not isinstance(spec.entry_point, str):
        # For environments that moved to another package, Gymnasium registers a function that
        # raises. The type is ignored because Gymnasium's creator protocol has no __name__.
        moved = spec.entry_point is None or spec.entry_point.__name__.startswith("_raise")  # type: ignore[attr-defined]
        return "it is no longer part of Gymnasium" if moved else None
    extra, module = _needs(spec)
    if module and not _is_installed(module):
        return f"it needs the server's extra '{extra}'" if extra else _needs_package(module)
    if spec.id in _BEFORE_MUJOCO_3 and _major_version("mujoco") >= 3:
        return "it needs a MuJoCo before version 3"
    package = spec.entry_point.partition(":")[0].partition(".")[0]
    return None if _is_installed(package) else _needs_package(package)


def _needs_package(module: str) -> str:
    return f"it needs the Python package '{module}', which no extra installs"


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


def unmet_module(spec: EnvSpec) -> str | None:
    """Return a module that an environment needs and that no extra installs, if it is missing."""
    extra, module = _needs(spec)
    return module if extra is None and module and not _is_installed(module) else None


def _needs(spec: EnvSpec) -> tuple[str | None, str | None]:
    if isinstance(spec.entry_point, str):
        for package, needs in _PACKAGES.items():
            if spec.entry_point.startswith((f"{package}.", f"{package}:")):
                return needs
    return None, None


def _is_installed(module: str) -> bool:
    # Look only for the top-level package: looking for submodules would import it.
    package = module.partition(".")[0]
    if package in sys.modules:
        return sys.modules[package] is not None
    return importlib.util.find_spec(package) is not None
