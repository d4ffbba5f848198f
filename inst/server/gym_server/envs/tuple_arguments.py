"""Convert lists, the only sequences in JSON, to tuples where a constructor requires tuples.

Most constructors accept any sequence, but some check for a tuple, such as Atari's for its
``frameskip``.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping


def with_tuples(creator: Callable, kwargs: dict) -> dict:
    """Convert lists in the arguments to tuples where the constructor requires tuples.

    It does if the default is a tuple, or if the annotation has tuples and no type that accepts a
    list.

    Args:
        creator: the class or function that makes the environment.
        kwargs: its arguments.
    """
    if not any(isinstance(value, list) for value in kwargs.values()):
        return kwargs
    parameters = parameters_of(creator)
    return {
        name: _as_tuple(value) if name in parameters and _wants(parameters[name]) else value
        for name, value in kwargs.items()
    }


def parameters_of(creator: Callable) -> Mapping[str, inspect.Parameter]:
    """Return the parameters of a class or function by name; none if they are not known."""
    try:
        return inspect.signature(creator).parameters
    except (TypeError, ValueError):
        return {}


def _wants(parameter: inspect.Parameter) -> bool:
    # The annotation as text: it may have names that are imported only for type checkers.
    annotation = str(parameter.annotation).lower()
    takes_lists = re.search("list|sequence|iterable|collection", annotation)
    return isinstance(parameter.default, tuple) or ("tuple" in annotation and not takes_lists)


def _as_tuple(value: object) -> object:
    return tuple(map(_as_tuple, value)) if isinstance(value, list) else value
