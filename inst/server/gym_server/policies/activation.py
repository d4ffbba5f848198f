"""The activations of a network's layers, computed in place.

The formulas are R's ``tanh()`` and ``plogis()``, and ``Gompertz``, ``ReLU`` and ``leakyReLU`` of
its package sigmoid. Do not replace them by formulas that are only mathematically equal: exact ties
matter, because the first of several largest outputs wins.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

Steps = list[Callable[[], object]]

# Activations with a bounded range, which can be stretched to an action's bounds.
HAVE_RANGE = frozenset({"tanh", "logistic", "Gompertz"})

# The largest number whose exp() is finite. NumPy warns beyond it.
_LARGEST_EXPONENT = np.array(np.log(np.finfo(np.float64).max))
_ONE = np.array(1.0)
_ZERO = np.array(0.0)
_LEAK = np.array(0.01)


def _tanh(x: np.ndarray) -> Steps:
    return [partial(np.tanh, x, x)]


def _identity(x: np.ndarray) -> Steps:
    return []


def _exp_of_negative(x: np.ndarray) -> Steps:
    return [
        partial(np.negative, x, x),
        partial(np.minimum, x, _LARGEST_EXPONENT, out=x),
        partial(np.exp, x, x),
    ]


def _logistic(x: np.ndarray) -> Steps:
    return [*_exp_of_negative(x), partial(np.add, x, _ONE, x), partial(np.divide, _ONE, x, x)]


def _gompertz(x: np.ndarray) -> Steps:
    return [*_exp_of_negative(x), partial(np.negative, x, x), partial(np.exp, x, x)]


def _relu(x: np.ndarray) -> Steps:
    return [partial(np.maximum, x, _ZERO, out=x)]


def _leaky_relu(x: np.ndarray) -> Steps:
    leak = np.empty_like(x)
    return [partial(np.multiply, x, _LEAK, leak), partial(np.maximum, x, leak, out=x)]


_STEPS: dict[str, Callable[[np.ndarray], Steps]] = {
    "tanh": _tanh,
    "logistic": _logistic,
    "identity": _identity,
    "Gompertz": _gompertz,
    "ReLU": _relu,
    "leakyReLU": _leaky_relu,
}

NAMES = tuple(_STEPS)


def in_place(name: str, x: np.ndarray) -> Steps:
    """Return the calls that turn a layer's sums into its outputs, in place."""
    return _STEPS[name](x)


def middle(name: str) -> float:
    """Return the threshold above which a single output stands for the second of two actions.

    It is the middle of the output's range, or 0 without a range. An output exactly in the middle,
    even by rounding, stands for the first action.
    """
    return 0.5 if name in ("logistic", "Gompertz") else 0.0
