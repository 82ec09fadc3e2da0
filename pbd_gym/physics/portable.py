"""Elementary functions that give the same bits on every machine.

Library versions of exp, sin and cos differ in their last bits between processors, as they choose
other instructions on each. These use only +, -, *, / on float64, which IEEE 754 defines exactly.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pbd_gym.physics.compiling import entry


def exp(y: Any) -> np.ndarray:
    """Return e^y for y <= 0, elementwise in float64; relative error below 1e-13.

    Values below -64 give e^-64, which is 0 for every reward.
    """
    values = np.asarray(y, dtype=np.float64, order="C")
    result = np.empty(values.shape)
    _exp(values.reshape(-1), result.reshape(-1))
    return result


@entry
def exp_scalar(y: float) -> float:
    """Return e^y for one number y <= 0, for use within kernels: the same bits as `exp`.

    e^y = (e^(y/256))^256: a Taylor polynomial on [-0.25, 0], then eight squarings.
    """
    small = max(y, -64.0) * (1.0 / 256.0)
    total = 1.0
    for degree in range(11, 0, -1):
        total = 1.0 + total * small * (1.0 / degree)
    for _ in range(8):
        total = total * total
    return total


@entry
def _exp(values: Any, result: Any) -> None:
    """Apply `exp_scalar` elementwise."""
    for index in range(values.shape[0]):
        result[index] = exp_scalar(values[index])


def cos_sin(angle: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return cosine and sine of an angle in [-pi, pi] [rad], elementwise in float64.

    Taylor polynomials of angle/4 (below 0.79 in size), then the double-angle formulas twice;
    absolute error below 1e-14.
    """
    quarter = np.asarray(angle, dtype=np.float64) * 0.25
    square = quarter * quarter
    cosine = np.ones_like(quarter)
    sine = np.ones_like(quarter)
    for degree in range(18, 0, -2):
        cosine = 1.0 - cosine * square * (1.0 / (degree * (degree - 1)))
        sine = 1.0 - sine * square * (1.0 / (degree * (degree + 1)))
    sine = sine * quarter
    for _ in range(2):
        cosine, sine = cosine * cosine - sine * sine, 2.0 * cosine * sine
    return cosine, sine
