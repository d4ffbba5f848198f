"""The paths that clients may pass to environments and wrappers."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from pathlib import Path

from gym_server.envs.config import EnvConfig
from gym_server.errors import GymServerError
from gym_server.json_values import brief

# Separators of any system, a home directory, a drive, a leading dot (a hidden file or a parent
# directory), and the zero that ends a C string.
_PATH_LIKE = re.compile(r"[/\\\0]|^[~.]|^[A-Za-z]:")

# Deeper than the arguments of any constructor, and far below Python's recursion limit.
_DEEPEST = 32


class AllowedPaths:
    """The files of this machine that clients may name."""

    def __init__(self, directories: Collection[Path] | None = None) -> None:
        """Set the allowed directories.

        Args:
            directories: paths must be below one of them; None allows any path, for a server whose
                only client is the user who started it.
        """
        self._directories = None if directories is None else [d.resolve() for d in directories]

    def check(self, config: EnvConfig) -> None:
        """Refuse paths that are not allowed, in all arguments of the environment and its wrappers.

        Raises:
            GymServerError: ``invalid_kwargs``.
        """
        self._check(config.kwargs or {}, "'kwargs'")
        for wrapper in config.wrappers:
            self._check(wrapper.kwargs, wrapper.name)

    def _check(self, kwargs: dict, owner: str) -> None:
        for text in _texts(kwargs, owner):
            if self._directories is None or _PATH_LIKE.search(text) is None:
                continue
            if not self._lies_below(text, self._directories):
                raise GymServerError(
                    "invalid_kwargs",
                    f"{owner}: {brief(text)} may be a path, and it is not below a directory that "
                    "the server's operator allowed",
                    "start the server with --allow-path DIR, and send the absolute path",
                )

    def _lies_below(self, text: str, directories: list[Path]) -> bool:
        try:
            path = Path(text)
            # The meaning of a relative path depends on the process that opens it.
            return path.is_absolute() and any(d in path.resolve().parents for d in directories)
        except (OSError, RuntimeError, ValueError):
            return False


def _texts(value: object, owner: str, depth: int = 0) -> Iterator[str]:
    """Return all strings in a JSON value, including field names."""
    if depth > _DEEPEST:
        raise GymServerError(
            "invalid_kwargs", f"{owner}: lists are nested more than {_DEEPEST} levels deep"
        )
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for name, item in value.items():
            yield name
            yield from _texts(item, owner, depth + 1)
    elif isinstance(value, list):
        for item in value:
            yield from _texts(item, owner, depth + 1)
