"""Convert lists, the only sequences in JSON, to tuples where a constructor requires tuples.

Most constructors accept any sequence, but some check for a tuple, such as Atari's for its
``frameskip``.
"""

from __future__ import annotations

import inspect
import types
import typing
from collections.abc import Callable


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


def parameters_of(creator: Callable) -> typing.Mapping[str, inspect.Parameter]:
    """Return the parameters of a class or function by name; none if they are not known."""
    # Evaluating an annotation fails if it is a string with names that are imported only for type
    # checkers, or for any other reason.
    for eval_str in (True, False):
        try:
            return inspect.signature(creator, eval_str=eval_str).parameters
        except Exception:
            continue
    return {}


def _wants(parameter: inspect.Parameter) -> bool:
    kinds = {typing.get_origin(one) or one for one in _members(parameter.annotation)}
    takes_lists = any(isinstance(kind, type) and issubclass(list, kind) for kind in kinds)
    return isinstance(parameter.default, tuple) or (tuple in kinds and not takes_lists)


def _members(annotation: object) -> tuple:
    """Return the members of a union, or the annotation itself."""
    is_union = typing.get_origin(annotation) in (typing.Union, types.UnionType)
    return typing.get_args(annotation) if is_union else (annotation,)


def _as_tuple(value: object) -> object:
    return tuple(map(_as_tuple, value)) if isinstance(value, list) else value
