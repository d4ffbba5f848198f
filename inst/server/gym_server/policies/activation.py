"""The activations of a network's layers, computed in place.

The formulas are those of R: ``tanh()`` and ``plogis()``; ``Gompertz``, ``ReLU`` and ``leakyReLU``
are those of its package sigmoid. Exact ties matter, because the first of several largest outputs
wins: no formula that is equal only on paper takes their place.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

Steps = list[Callable[[], object]]

# Those whose outputs have a range, from which they can be stretched to an action's bounds.
HAVE_RANGE = frozenset({"tanh", "logistic", "Gompertz"})

# The largest number of which exp() is finite. Beyond it NumPy warns.
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
    """Return the calls that turn the sums of a layer into its outputs, in the same array."""
    return _STEPS[name](x)


def above_middle(name: str) -> Callable[[float], bool]:
    """Return whether the sum of an only output neuron stands for the second of two actions.

    It does where the output is above the middle of its range; without a range above 0. Exactly
    the middle is the first action, also where rounding makes it the middle.
    """
    return {"logistic": _logistic_above_half, "Gompertz": _gompertz_above_half}.get(
        name, _above_zero
    )


def _above_zero(x: float) -> bool:
    return x > 0.0


def _logistic_above_half(x: float) -> bool:
    return x > 0.0 and 1.0 / (1.0 + math.exp(-x)) > 0.5


def _gompertz_above_half(x: float) -> bool:
    # exp(-exp(1)) is below one half; a number far below 0 would overflow.
    return x > -1.0 and math.exp(-math.exp(-x)) > 0.5


def rows_above_middle(name: str, outputs: Any) -> Any:
    """Return ``above_middle()`` of many outputs, which have been through the activation."""
    return outputs > (0.5 if name in ("logistic", "Gompertz") else 0.0)
