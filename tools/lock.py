"""Write inst/server/lock/; called by tools/lock, with a folder to work in.

One resolution serves all extras, all systems and all Pythons that the server supports. base.txt has
the server's own requirements, and EXTRA.txt those that an extra adds, in the format of pip and uv.
Their first lines are comments, "# key: value", which R reads.
"""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import tomllib
from packaging import tags
from packaging.markers import Marker
from packaging.utils import parse_wheel_filename

SERVER = Path(__file__).parent.parent / "inst" / "server"
EXTRAS = ("toy-text", "box2d", "mujoco", "atari", "video", "jax", "sb3")
PYTHONS = ((3, 10), (3, 11), (3, 12), (3, 13))
# The Python that gym_server_install() installs.
USUAL_PYTHON = (3, 12)


def _manylinux(machine: str) -> list[str]:
    # glibc 2.28: Debian 10, Ubuntu 20.04, RHEL 8 and later.
    return [f"manylinux_2_{minor}_{machine}" for minor in range(28, 4, -1)] + [
        f"manylinux{old}_{machine}" for old in ("2014", "2010", "1")
    ]


# By the name in R (system_name()): the values of markers, the tags of wheels. macOS 14 is the
# oldest for which opencv-python-headless still has wheels.
SYSTEMS = {
    "linux-x86_64": ("linux", "x86_64", _manylinux("x86_64")),
    "linux-aarch64": ("linux", "aarch64", _manylinux("aarch64")),
    "darwin-x86_64": ("darwin", "x86_64", list(tags.mac_platforms((14, 0), "x86_64"))),
    "darwin-arm64": ("darwin", "arm64", list(tags.mac_platforms((14, 0), "arm64"))),
    "windows-x86_64": ("win32", "AMD64", ["win_amd64"]),
}


def main(folder: Path) -> None:
    """Resolve the requirements of pyproject.toml, and write a file for each part."""
    pyproject = SERVER / "pyproject.toml"
    project = tomllib.loads(pyproject.read_text(encoding="utf-8"))["project"]
    _write_project(project, folder)
    _uv("lock", cwd=folder)
    locked = tomllib.loads((folder / "uv.lock").read_text(encoding="utf-8"))["package"]
    packages = {(package["name"], package["version"]): package for package in locked}
    files = {"base": _export(folder, [])}
    for extra in EXTRAS:
        files[extra] = _without(_export(folder, ["--extra", extra]), files["base"])
    asked = fingerprint(project)
    (SERVER / "lock").mkdir(exist_ok=True)
    for name, requirements in files.items():
        path = SERVER / "lock" / f"{name}.txt"
        path.write_text("".join(f"{r}\n" for r in requirements.values()), encoding="utf-8")
        missing = set(_systems_without_wheels(requirements, packages))
        missing |= set(_systems_left_out(project["optional-dependencies"].get(name, [])))
        header = {
            "made by": "tools/lock",
            "fingerprint": asked,
            "download": f"{_download(requirements, packages) / 1e6:.0f} MB",
            "disk": f"{_disk(path, folder / 'disk' / name) / 1e6:.0f} MB",
            "not for": ", ".join(sorted(missing)) or "none",
        }
        lines = [f"# {key}: {value}\n" for key, value in header.items()]
        path.write_text("".join(lines) + path.read_text(encoding="utf-8"), encoding="utf-8")
        print(path, {key: header[key] for key in ("download", "disk", "not for")})


def fingerprint(project: dict) -> str:
    """Return a hash of the dependencies; the server's tests compute it, too."""
    asked = [
        project["dependencies"],
        {e: project["optional-dependencies"][e] for e in EXTRAS},
    ]
    return hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:16]


def _write_project(project: dict, folder: Path) -> None:
    # The server may run on a later Python, but not with everything that is locked.
    text = [
        '[project]\nname = "locked"\nversion = "0"\nrequires-python = ">=3.10,<3.14"\n',
        f"dependencies = {json.dumps(project['dependencies'])}\n[project.optional-dependencies]\n",
        *(f"{extra} = {json.dumps(project['optional-dependencies'][extra])}\n" for extra in EXTRAS),
        "[tool.uv]\npackage = false\nno-build = true\n",
        # If the newest release of a package has no wheels for these, use an older one.
        "required-environments = [\"sys_platform == 'darwin' and platform_machine == 'x86_64'\"]\n",
    ]
    (folder / "pyproject.toml").write_text("".join(text), encoding="utf-8")


def _uv(*arguments: str, cwd: Path) -> str:
    command = [Path(sys.executable).with_name("uv"), *arguments]
    return subprocess.run(command, cwd=cwd, check=True, stdout=subprocess.PIPE, text=True).stdout


def _export(folder: Path, extras: list[str]) -> dict[str, str]:
    """Return the requirements with hashes, by the part before the hashes."""
    text = _uv(
        "export",
        "--quiet",
        "--frozen",
        "--no-header",
        "--no-annotate",
        *extras,
        cwd=folder,
    )
    blocks = re.split(r"\n(?=\S)", text.strip())
    return {block.partition(" \\\n")[0]: block for block in blocks}


def _without(requirements: dict[str, str], others: dict[str, str]) -> dict[str, str]:
    return {key: text for key, text in requirements.items() if key not in others}


def _needed(key: str, system: str, python: tuple[int, int]) -> tuple[str, str] | None:
    pinned, _, marker = key.partition(" ; ")
    platform, machine, _ = SYSTEMS[system]
    version = ".".join(map(str, python))
    environment = {
        "sys_platform": platform,
        "platform_machine": machine,
        "platform_system": {"win32": "Windows", "darwin": "Darwin", "linux": "Linux"}[platform],
        "os_name": "nt" if platform == "win32" else "posix",
        "python_version": version,
        "python_full_version": f"{version}.9",
        "implementation_name": "cpython",
        "platform_python_implementation": "CPython",
    }
    if marker and not Marker(marker).evaluate(environment):
        return None
    name, _, version = pinned.partition("==")
    return name, version


def _wheel(package: dict, system: str, python: tuple[int, int]) -> dict | None:
    platforms = SYSTEMS[system][2]
    interpreter = f"cp{python[0]}{python[1]}"
    fits = {
        *tags.cpython_tags(python, platforms=platforms),
        *tags.compatible_tags(python, interpreter, platforms),
    }
    for wheel in package.get("wheels", ()):
        if parse_wheel_filename(wheel["url"].rpartition("/")[2])[3] & fits:
            return wheel
    return None


def _systems_without_wheels(requirements: dict[str, str], packages: dict) -> Iterator[str]:
    for key in requirements:
        for system in SYSTEMS:
            for python in PYTHONS:
                needed = _needed(key, system, python)
                if needed and not _wheel(packages[needed], system, python):
                    print(f"No wheel of {key} for {system}, Python {python}")
                    yield system


def _systems_left_out(declared: list[str]) -> Iterator[str]:
    """Return the systems for which an extra's own markers leave nothing."""
    for system in SYSTEMS:
        if declared and not any(_needed(key, system, USUAL_PYTHON) for key in declared):
            yield system


def _download(requirements: dict[str, str], packages: dict) -> int:
    """Return the bytes to download on the system with the largest files."""

    def size(system: str) -> int:
        needed = filter(None, (_needed(key, system, USUAL_PYTHON) for key in requirements))
        wheels = filter(None, (_wheel(packages[pin], system, USUAL_PYTHON) for pin in needed))
        return sum(wheel["size"] for wheel in wheels)

    return max(map(size, SYSTEMS))


def _disk(path: Path, target: Path) -> int:
    """Return the bytes of an installation on Linux with an Intel processor."""
    _uv(
        *(
            "pip",
            "install",
            "--quiet",
            "--no-deps",
            "--no-build",
            "--link-mode",
            "copy",
        ),
        *("--python-platform", "x86_64-manylinux_2_28", "--python-version"),
        *(".".join(map(str, USUAL_PYTHON)), "--target", str(target), "-r", str(path)),
        cwd=path.parent,
    )
    return sum(file.stat().st_size for file in target.rglob("*") if file.is_file())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
