"""What the texts in arguments of environments and wrappers may be."""

from __future__ import annotations

import re
from collections.abc import Iterator

from gym_server.envs.config import EnvConfig
from gym_server.errors import GymServerError
from gym_server.json_values import brief

# Separators of any system, a home directory, a drive, a leading dot (a hidden file or a parent
# directory), and the zero that ends a C string.
_PATH_LIKE = re.compile(r"[/\\\0]|^[~.]|^[A-Za-z]:")

# Deeper than the arguments of any constructor, and far below Python's recursion limit.
_DEEPEST = 32


def check(config: EnvConfig, may_name_files: bool) -> None:
    """Check all arguments of an environment and its wrappers.

    Args:
        config: what the client chose.
        may_name_files: whether an argument may be the path of a file, such as MuJoCo's
            ``xml_file``.

    Raises:
        GymServerError: ``invalid_kwargs``.
    """
    arguments = [("'kwargs'", config.kwargs or {})]
    arguments += [(wrapper.name, wrapper.kwargs) for wrapper in config.wrappers]
    for owner, kwargs in arguments:
        for text in _texts(kwargs, owner):
            if not may_name_files and _PATH_LIKE.search(text):
                raise GymServerError(
                    "invalid_kwargs",
                    f"{owner}: {brief(text)} may be a path, and this server reads no files for its "
                    "clients",
                    "use a server of your own, such as the one that gym_make() starts; with "
                    "--users, one that root started",
                )


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
